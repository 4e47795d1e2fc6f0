//! A damper's parameters, declared once: names, units, bounds, scale, nominal values, prose.

/// How a parameter is spread over its range, in search and in figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Evenly in its logarithm; both bounds are positive.
    Log,
    /// Evenly; the parameter shifts the loop, so the model is odd only where it is zero.
    Offset,
}

impl Scale {
    /// Its name in the spec.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Log => "log",
            Self::Offset => "offset",
        }
    }
}

/// One parameter of a damper model.
#[derive(Clone, Copy, Debug)]
pub struct ParamSpec {
    /// Name, as in the equation.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Spread over the range.
    pub scale: Scale,
    /// Smallest admissible value.
    pub lower: f64,
    /// Largest admissible value.
    pub upper: f64,
    /// A typical value, from the source the model names.
    pub nominal: f64,
    /// What it does.
    pub description: &'static str,
}

/// Parameters that can be filled in spec order.
pub trait FromSlice<R>: Copy {
    /// Takes one value per parameter; those that are missing are not a number.
    fn from_slice(values: &[R]) -> Self;
}

/// Declares the parameters of the model in this file: a struct `Parameters<R>` to compute with and a
/// list `PARAMETERS` to read.
///
/// ```text
/// parameters! {
///     c: "N s/m", Log, 1.0 .. 1e7, nominal 5e3, "viscous damping";
/// }
/// ```
macro_rules! parameters {
    ($($name:ident: $unit:literal, $scale:ident, $lower:literal .. $upper:literal,
       nominal $nominal:expr, $description:literal;)+) => {
        /// The model's parameters, in spec order.
        #[derive(Clone, Copy, Debug)]
        #[allow(missing_docs, non_snake_case)] // described in PARAMETERS; letters as in the equation
        pub struct Parameters<R> { $(pub $name: R),+ }

        impl<R: $crate::real::Real> $crate::parameters::FromSlice<R> for Parameters<R> {
            #[inline(always)]
            fn from_slice(values: &[R]) -> Self {
                let mut values = values.iter();
                Self { $($name: match values.next() {
                    Some(&value) => value,
                    None => R::splat(f64::NAN),
                }),+ }
            }
        }

        /// Names, units, bounds and prose, in order.
        pub const PARAMETERS: &[$crate::parameters::ParamSpec] = &[
            $($crate::parameters::ParamSpec {
                name: stringify!($name),
                unit: $unit,
                scale: $crate::parameters::Scale::$scale,
                lower: $lower,
                upper: $upper,
                nominal: $nominal,
                description: $description,
            }),+
        ];
    };
}
pub(crate) use parameters;
