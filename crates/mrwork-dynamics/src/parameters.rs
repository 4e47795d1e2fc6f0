//! Parameters of a damper model, declared once: names, units, bounds, scale, nominal values, descriptions.

/// Scale of a parameter, in searches and in figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Linear.
    Linear,
    /// Logarithmic; both bounds are positive.
    Log,
    /// Linear; the parameter shifts the loop, so the model is odd only if it is zero.
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
    /// Scale.
    pub scale: Scale,
    /// Smallest admissible value.
    pub lower: f64,
    /// Largest admissible value.
    pub upper: f64,
    /// Typical value, from the source that the model names.
    pub nominal: f64,
    /// Meaning.
    pub description: &'static str,
    /// Whether it enters the force only, not the rate of the states: derivatives with respect to it need no integration.
    /// Of a model without states it is not said.
    pub force_only: bool,
}

/// The parameters that shift the loop, by their places.
pub(crate) fn offsets(parameters: &[ParamSpec]) -> Vec<usize> {
    (0..parameters.len()).filter(|&place| parameters[place].scale == Scale::Offset).collect()
}

/// Parameters that can be filled in spec order.
pub trait FromSlice<R>: Clone {
    /// Takes one value per parameter; missing values are not a number.
    fn from_slice(values: &[R]) -> Self;
    /// Takes the values of parameters that `follow` the command; others, and what is derived from others alone, stay.
    fn follow(&mut self, values: &[R], follow: &[bool]);
}

/// Declares the parameters of the model in this file: a struct `Parameters<R>` to compute with and a list `PARAMETERS` to
/// read. Quantities that depend on parameters alone, which are named, can be listed after them: they become fields too and
/// are computed once instead of in every step. `force_only` stands with a parameter on which the rate of the states does not depend.
///
/// ```text
/// parameters! {
///     k_w: "N", Log, 1e-3 .. 1e9, nominal 300.0, force_only, "yield force";
///     rho: "1/m", Log, 1e-2 .. 1e7, nominal 3000.0, "initial slope of the loop";
///     => per_rho of rho: R = R::splat(1.0) / rho;
/// }
/// ```
macro_rules! parameters {
    ($($name:ident: $unit:literal, $scale:ident, $lower:literal .. $upper:literal,
       nominal $nominal:expr, $($force_only:ident,)? $description:literal;)+
     $(=> $($derived:ident of $($of:ident),+: $kind:ty = $value:expr;)+)?) => {
        /// The model's parameters, in spec order, and the quantities derived from them.
        #[derive(Clone, Copy)]
        #[allow(missing_docs)] // described in PARAMETERS
        #[allow(non_snake_case)] // letters as in the equation
        #[allow(dead_code)] // some are read only through derived quantities
        pub struct Parameters<R: $crate::real::Real> { $(pub $name: R,)+ $($(pub $derived: $kind,)+)? }

        impl<R: $crate::real::Real> $crate::parameters::FromSlice<R> for Parameters<R> {
            #[inline(always)]
            #[allow(non_snake_case)] // letters as in the equation
            fn from_slice(values: &[R]) -> Self {
                let mut values = values.iter();
                $(let $name = match values.next() {
                    Some(&value) => value,
                    None => R::splat(f64::NAN),
                };)+
                Self { $($($derived: $value,)+)? $($name),+ }
            }
            #[inline(always)]
            #[allow(non_snake_case)] // letters as in the equation
            #[allow(unused_variables)] // those on which no derived quantity depends
            fn follow(&mut self, values: &[R], follow: &[bool]) {
                let (mut values, mut follow) = (values.iter(), follow.iter());
                $(let $name = match (values.next(), follow.next()) {
                    (Some(&value), Some(true)) => {
                        self.$name = value;
                        true
                    }
                    _ => false,
                };)+
                $($(if false $(|| $of)+ {
                    let Self { $($of,)+ .. } = *self;
                    self.$derived = $value;
                })+)?
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
                force_only: $crate::parameters::parameters!(@$($force_only)?),
            }),+
        ];
    };
    (@) => { false };
    (@force_only) => { true };
}
pub(crate) use parameters;
