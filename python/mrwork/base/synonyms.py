"""What engineers call a thing that has another name here: words of papers, of OpenSees, SAP2000, ETABS and libraries.

Keys of files, options of commands, arguments of functions and names to choose from are all looked up in this one table,
before their spelling. Words that are spelled like the name here need no entry.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

# Names here, of which the first that exists among the known ones is meant, and the words for them; "a|b" means both.
# Words count in any case and style, also in the plural.
_WORDS: Final[Mapping[str, str]] = {
    "building": "structure frame mdof sdof",
    "damper": "mrd device semi_active_damper actuator",
    "clipped_optimal controller": "lqr lqg h2 hinf lqi optimal_control",
    "controller law laws controllers": "law controller regulator",
    "controller law search": "algorithm strategy method",
    "motion file": "earthquake record quake seismic excitation accelerogram loading load load_case time_history ground",
    "acceleration": "samples array values ag",
    "file folder": "path dir",
    "hardware": "loop sensor sampling measurement control_loop",
    "baseline": "reference benchmark compare",
    "report": "output figure result page plot",
    "uncertainty": "monte_carlo robustness scatter",
    "tune": "optimise optimize optimisation optimization ga nsga",
    "name label title": "label title id description name",
    "masses mass": "m mass floor_mass storey_mass story_mass seismic_mass",
    "stiffnesses stiffness gain": "k stiffness interstorey_stiffness ke spring",
    "storey_damping damping": "c cd dashpot damping_coefficient",
    "rayleigh|modal_damping ratios ratio damping ground_damping": (
        "zeta xi ksi damping_ratio inherent_damping damp damping_factor percent_damping"
    ),
    "a0 rayleigh": "alpha mass_proportional",
    "a1 rayleigh": "beta beta_k stiffness_proportional",
    "n_storeys storey floor": "n_floors number_of_floors num_floors level floor storey position story",
    "published preset": "benchmark preset paper",
    "isolation": "bearing",
    "lead_rubber": "lrb",
    "period frequency stiffnesses": "t t1 tn fundamental_period",
    "frequency ground_frequency period stiffnesses": "f f1 fn omega wn freq",
    "viscous": "fvd",
    "yielding": "metallic brb",
    "friction": "slip_damper",
    "tuned_mass": "tmd mass_damper",
    "liquid_column": "tlcd tld",
    "brace": "chevron brace_stiffness",
    "characteristic_strength yield_force": "fy qd yield_strength yield_load",
    "yield_displacement": "dy uy",
    "post_yield_ratio": "hardening hardening_ratio strain_hardening",
    "mass_ratio": "mu",
    "law model published synthetic": "type kind damper_model",
    "run": "fit fitted_damper",
    "settings parameters theta": "params parameters property coefficients options x p",
    "lag delay": "driver_lag tau",
    "command|largest_command command largest_command": "current voltage i v amps volts ampere",
    "largest_command command": "maximum_current maximum_voltage i_max v_max saturation",
    "command_rate command_slope": "slew_rate ramp",
    "count n_storeys motions realisations": "n num number n_dampers number_of_dampers n_motions",
    "control_weight settings": "r",
    "state_weight settings": "q drifts accelerations",
    "gain": "feedback_gain",
    "user": "python script custom_law function",
    "decentralised_bang_bang": "bang_bang on_off",
    "predictive_rollout": "mpc",
    "sliding_mode": "smc",
    "inverse_network": "ann neural nn",
    "fuzzy": "flc",
    "passive_off": "off",
    "passive_on": "on",
    "best_passive": "best_constant",
    "bouc_wen": "bw",
    "modified_bouc_wen": "mbw spencer",
    "pga": "peak peak_acceleration peak_ground_acceleration a_max ag pga_g",
    "sa": "spectral_acceleration sa_t1 target_sa pseudo_acceleration sa_g psa",
    "sa_period": "t1 fundamental_period",
    "sa_damping": "zeta xi",
    "target": "design_spectrum response_spectrum spectrum",
    "scale_to": "match matching",
    "ground": "soil soil_class soil_type site_class",
    "factor": "scale scaling sf amplification",
    "sample_time dt resample": "sampling_period sampling_interval sampling_rate sampling_frequency fs ts",
    "dt step": "time_step delta_t h dt",
    "duration end": "length total_time time t_end t_max t_final",
    "start": "begin t0 from",
    "synthetic": "artificial random white_noise kanai_tajimi simulated",
    "soil": "site site_class ground_filter",
    "delay": "latency dead_time",
    "acceleration_noise": "noise sensor_noise noise_rms",
    "feedback": "observer estimator kalman kalman_filter",
    "measured_floors": "accelerometer sensors",
    "realisations": "samples draws",
    "budget": "iterations trials candidates",
    "search": "optimizer optimiser solver",
    "criteria": "objective cost cost_function",
    "constraints bounds": "limit",
    "free bounds": "bounds variables ranges search_space box",
    "rng seed": "seed random_state random_seed",
    "threads": "n_jobs workers jobs parallel",
    "tests": "record data test",
    "record": "test data loading",
    "model": "spec damper",
    "on_progress": "callback",
    "seconds": "timeout time_limit max_time",
    "until": "target tolerance ftol",
    "out": "output_dir save results",
    "replace": "overwrite force",
}


def without_style(name: str) -> str:
    """`BoucWen`, `bouc-wen` and `bouc_wen` alike."""
    return "".join(character for character in name.lower() if character.isalnum())


def synonyms(name: str) -> list[list[str]]:
    """Names here that a word may mean, the likelier first; those in one list are meant alike."""
    word = without_style(name)
    return [
        alike.split("|")
        for targets, words in _WORDS.items()
        if {word, word.removesuffix("s"), word.removesuffix("es")}
        & {without_style(part) for part in words.split()}
        for alike in targets.split()
    ]
