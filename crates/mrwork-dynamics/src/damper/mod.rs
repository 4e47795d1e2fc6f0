//! The registry of damper models: one model per file, written over the trait of [`model`].

mod backlash_bouc_wen;
mod bingham;
mod bouc_wen;
mod dahl;
mod elasto_visco_plastic;
mod extended_bingham;
mod hyperbolic_tangent_gavin;
mod hyperbolic_tangent_guo;
mod ideal_actuator;
mod lugre;
mod maxwell;
pub mod model;
mod modified_bouc_wen;
mod non_symmetric_bouc_wen;
mod non_symmetric_bouc_wen_displacement;
mod normalised_bouc_wen;
mod normalised_modified_bouc_wen;
mod orifice;
pub mod own;
mod polynomial_fitting;
mod shear_thinning_modified_bouc_wen;
pub(crate) mod static_hysteretic;
mod viscous_dahl;

use crate::any_damper::Damper;
use ideal_actuator::IdealActuator;
pub(crate) use model::ModelVisitor;
pub use model::{DamperModel, DamperSpec, Motion, MotionNumber, Severity, State};
pub(crate) use normalised_bouc_wen::{Hysteresis, fastest_relaxation};

macro_rules! models {
    ($($module:ident::$model:ident,)+) => {
        /// Every damper model, one line each.
        pub static REGISTRY: &[&dyn Damper] = &[$(&$module::$model,)+];

        /// Does the work of a visitor for the device of that name: a damper model, the ideal actuator or a damper of a user.
        pub(crate) fn visit<T>(name: &str, visitor: impl ModelVisitor<T>) -> Option<T> {
            $(if name == $module::$model::SPEC.name {
                return Some(visitor.visit($module::$model));
            })+
            if name == IdealActuator::SPEC.name {
                return Some(visitor.visit(IdealActuator));
            }
            own::visit(name, visitor)
        }
    };
}

models! {
    backlash_bouc_wen::BacklashBoucWen,
    bingham::Bingham,
    bouc_wen::BoucWen,
    dahl::Dahl,
    elasto_visco_plastic::ElastoViscoPlastic,
    extended_bingham::ExtendedBingham,
    hyperbolic_tangent_gavin::HyperbolicTangentGavin,
    hyperbolic_tangent_guo::HyperbolicTangentGuo,
    lugre::LuGre,
    maxwell::Maxwell,
    modified_bouc_wen::ModifiedBoucWen,
    non_symmetric_bouc_wen::NonSymmetricBoucWen,
    non_symmetric_bouc_wen_displacement::NonSymmetricBoucWenDisplacement,
    normalised_bouc_wen::NormalisedBoucWen,
    normalised_modified_bouc_wen::NormalisedModifiedBoucWen,
    orifice::Orifice,
    polynomial_fitting::PolynomialFitting,
    shear_thinning_modified_bouc_wen::ShearThinningModifiedBoucWen,
    static_hysteretic::StaticHysteretic,
    viscous_dahl::ViscousDahl,
}

/// The model of that name, of the registry or of a user.
#[must_use]
pub fn find(name: &str) -> Option<&'static dyn Damper> {
    REGISTRY.iter().copied().find(|damper| damper.spec().name == name).or_else(|| own::find(name))
}

/// The device of a closed loop with that name: a damper model or the ideal actuator.
#[must_use]
pub fn find_device(name: &str) -> Option<&'static dyn Damper> {
    find(name).or_else(|| {
        let actuator: &'static dyn Damper = &IdealActuator;
        (actuator.spec().name == name).then_some(actuator)
    })
}
