"""What engineers call a thing that has another name here: words of papers, of OpenSees, SAP2000, ETABS and libraries.

Keys of files, options of commands, arguments of functions and names to choose from are all looked up in this one table,
before their spelling.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

# Names here, in the order in which the first that exists at the place is meant, and the words for them; "a|b" means
# both. Words count in any case and style, also in the plural.
_WORDS: Final[Mapping[str, str]] = {
    # Tables of a study.
    "building": "structure frame structural_model shear_building shear_frame tower mdof sdof plant geometry",
    "damper": "mr_damper mrd device magnetorheological_damper semi_active_damper actuator link link_element nllink",
    "clipped_optimal controller": "lqr lqg h2 hinf lqi optimal_control clipped_lqr clipped_lqg",
    "controller law laws controllers": "law controller regulator control control_law feedback_law",
    "controller law search": "algorithm strategy control_strategy control_algorithm method",
    "motion file": (
        "earthquake motion record ground_motion quake seismic excitation accelerogram seismogram ground_record eq "
        "loading load load_case load_pattern time_history uniform_excitation ground input_motion"
    ),
    "acceleration": "samples array values ag",
    "file folder": "path filename filepath csv directory dir",
    "hardware": "loop sensor sampling daq dsp controller_hardware measurement control_loop acquisition",
    "baseline": "comparison reference benchmark alternative compare other_building baseline_correction detrend",
    "report": "output plot figure result page recorder",
    "uncertainty": "monte_carlo uncertain robustness scatter random_variable",
    "places": "placement placing positions damper_placement optimal_placement",
    "tune": "tuning optimise optimize optimisation optimization ga nsga",
    "name label title": "name label title caption legend id tag heading description",
    # Buildings and what is built in.
    "masses mass": "m mass floor_mass storey_mass story_mass lumped_mass nodal_mass seismic_mass mass_matrix",
    "stiffnesses stiffness gain": (
        "k stiffness storey_stiffness story_stiffness floor_stiffness lateral_stiffness interstorey_stiffness ke spring"
    ),
    "storey_damping damping": "c cd dashpot damping_coefficient story_damping floor_damping viscous_coefficient",
    "rayleigh|modal_damping ratios ratio damping ground_damping": (
        "zeta xi ksi damping_ratio modal_damping_ratio critical_damping inherent_damping structural_damping damp "
        "damping_factor percent_damping"
    ),
    "a0 rayleigh": "alpha alpha_m mass_proportional mass_coefficient",
    "a1 rayleigh": "beta beta_k beta_k_init beta_k_comm stiffness_proportional stiffness_coefficient",
    "n_storeys storey floor": (
        "story stories n_floors n_stories n_story number_of_floors number_of_storeys number_of_stories "
        "num_floors num_stories level floor storey location position dof ndof"
    ),
    "influence": "influence_vector iota",
    "published preset": "benchmark preset published literature paper",
    "isolation": "base_isolation isolator isolated bearing base_isolator",
    "lead_rubber": "lrb lead_rubber_bearing lead_rubber_isolator rubber_isolator",
    "period frequency stiffnesses": (
        "t t1 tn t_iso natural_period isolation_period fundamental_period target_period"
    ),
    "frequency ground_frequency period stiffnesses": (
        "f f1 fn freq omega wn w1 natural_frequency fundamental_frequency frequency_hz omega_g wg"
    ),
    "viscous": "fvd fluid_viscous_damper viscous_damper linear_damper oil_damper damper_exponential",
    "yielding": "metallic metallic_damper yielding_damper hysteretic_damper steel_damper adas tadas brb bouc_wen_brace",
    "friction": "friction_damper pall_damper slip_damper friction_brace",
    "tuned_mass": "tmd tuned_mass_damper mass_damper pendulum",
    "liquid_column": "tlcd tuned_liquid_column_damper liquid_damper tuned_liquid_damper tld",
    "brace": "bracing chevron k_brace brace_stiffness",
    "characteristic_strength yield_force": "fy qd characteristic_strength yield_strength yield_load",
    "yield_displacement": "dy uy yield_deformation yield_drift",
    "slip_load": "slip_force friction_force friction_load",
    "post_yield_ratio": "hardening hardening_ratio strain_hardening post_yield_stiffness_ratio post_yield_stiffness",
    "mass_ratio": "mu",
    # Dampers and laws.
    "law model published synthetic": (
        "type kind law_name controller_type damper_type damper_model material uniaxial_material"
    ),
    "run": "fit identified identification fitted_damper",
    "settings parameters theta": "params parameters properties property coefficients options weights args config x p",
    "lag delay": "driver_lag tau lag_rate driver_rate current_driver",
    "command|largest_command command largest_command": "current voltage i v amps volts ampere",
    "largest_command command": (
        "max_current max_voltage maximum_current maximum_voltage i_max v_max current_limit voltage_limit "
        "largest_current largest_voltage max_command saturation"
    ),
    "command_rate command_slope": "slew_rate rate_limit ramp max_rate current_rate voltage_rate",
    "dead_zone": "dead_band threshold",
    "count n_storeys motions realisations": "n num number quantity multiplicity n_dampers number_of_dampers n_motions",
    "control_weight settings": "control_weight r control_cost r_weight force_weight",
    "state_weight settings": "state_weight q q_weight state_cost drifts accelerations drift_weight",
    "gain": "gain_matrix feedback_gain lqr_gain k_lqr control_gain",
    "user": "python script custom custom_law user_law own_law function plugin",
    "mixed_skyhook": "sky_hook",
    "decentralised_bang_bang": "bang_bang on_off",
    "predictive_rollout": "mpc model_predictive predictive",
    "sliding_mode": "smc",
    "inverse_network": "ann neural neural_network nn",
    "fuzzy": "flc fuzzy_logic",
    "passive_off": "off zero no_control minimum",
    "passive_on": "on full maximum",
    "best_passive": "optimal_passive best_constant",
    "best_passive_by_group": "optimal_passive_by_group best_constant_by_group",
    "bouc_wen": "bw simple_bouc_wen",
    "modified_bouc_wen": "mbw spencer phenomenological",
    # Motions and the loop.
    "pga": (
        "peak peak_acceleration peak_ground_acceleration a_max ag amplitude target_pga pga_g scale_to intensity"
    ),
    "sa": "spectral_acceleration sa_t1 psa target_sa sa_g pseudo_acceleration",
    "sa_period": "t1 period first_period fundamental_period period_of_sa",
    "sa_damping": "damping damping_ratio zeta xi",
    "target": "target_spectrum design_spectrum response_spectrum spectrum",
    "scale_to": "match matching scaled_to scaling_method",
    "ground": "soil soil_class soil_type site_class ground_type",
    "factor": "scale scale_factor scaling sf amplification multiplier",
    "design_level": "level tuning_level design_intensity design_pga design_sa",
    "time_scale": "time_factor time_scaling scale_time compression",
    "sample_time dt resample": (
        "sampling_time sampling_period sampling_interval sample_period sample_rate sampling_rate sampling_frequency fs "
        "ts control_period control_interval"
    ),
    "dt step": "time_step delta_t integration_step h dt",
    "duration end": "length total_time time t_end t_max t_final",
    "start": "t_start begin t0 from",
    "synthetic": "artificial random white_noise stochastic kanai_tajimi clough_penzien simulated filtered_noise",
    "suite": "ensemble set_of_motions catalogue",
    "soil": "site site_class ground_filter soil_type",
    "use": "role purpose split",
    "rest": "pad padding zero_padding free_vibration",
    "delay": "time_delay latency dead_time transport_delay",
    "acceleration_noise": "noise sensor_noise measurement_noise accelerometer_noise noise_rms",
    "feedback": "observer estimator kalman kalman_filter state_feedback output_feedback",
    "measured_floors": "accelerometer sensors measured measurements sensor_locations",
    "fault": "failure sensor_fault sensor_failure",
    "realisations": "samples n_samples draws simulations",
    "budget": "evaluations iterations max_evals n_evals trials candidates",
    "search": "optimizer optimiser solver",
    "criteria": "objective cost cost_function performance_index fitness",
    "constraints bounds": "constraint limit",
    "free bounds": "bounds variables ranges design_variables search_space box",
    "population generations": "pop pop_size npop",
    # Options of commands and arguments of functions.
    "rng seed": "seed random_state random_seed",
    "threads": "n_jobs workers n_threads num_threads jobs cores parallel",
    "tests": "test record data",
    "record": "test data loading",
    "model": "spec damper",
    "on_progress": "callback progress",
    "seconds": "timeout time_limit max_time max_seconds",
    "until": "target tolerance ftol",
    "out": "output out_dir output_dir save results",
    "replace": "overwrite force",
    "quiet": "silent",
}


def without_style(name: str) -> str:
    """`BoucWen`, `bouc-wen` and `bouc_wen` alike."""
    return "".join(each for each in name.lower() if each.isalnum())


def synonyms(name: str) -> list[list[str]]:
    """Names here that a word may mean, the likelier first; those in one list are meant alike."""
    word = without_style(name)
    return [
        alike.split("|")
        for targets, words in _WORDS.items()
        if {word, word.removesuffix("s"), word.removesuffix("es")}
        & {without_style(each) for each in words.split()}
        for alike in targets.split()
    ]
