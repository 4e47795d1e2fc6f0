//! Chooses the instruction sets that are compiled: the best one of this machine, all of the architecture, or those named.
//!
//! All are compiled with the feature `all-sets`, where `MRWORK_BUILD_SETS` is `all`, and for another target than this
//! machine. `MRWORK_BUILD_SETS` may also name sets, as `avx2` or `avx512,plain`: the module then runs on every processor
//! that has one of them.

/// Environment variable that asks for `all` sets, or names some.
const BUILD_SETS: &str = "MRWORK_BUILD_SETS";
/// The instruction sets of x86-64, fastest first; every target has the last one.
const SETS: [&str; 3] = ["avx512", "avx2", "plain"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed={BUILD_SETS}");
    println!("cargo::rustc-check-cfg=cfg(compiled_avx512, compiled_avx2, compiled_plain)");
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    let asked = variable(BUILD_SETS);
    let of_target = if variable("CARGO_CFG_TARGET_ARCH") == "x86_64" { &SETS[..] } else { &SETS[2..] };
    let all = std::env::var_os("CARGO_FEATURE_ALL_SETS").is_some()
        || asked == "all"
        || (asked.is_empty() && variable("HOST") != variable("TARGET"));
    let chosen: Vec<&str> = match asked.as_str() {
        _ if all => of_target.to_vec(),
        "" => of_target.iter().copied().filter(|set| has(set)).take(1).collect(),
        names => names.split(',').map(str::trim).collect(),
    };
    for set in chosen {
        if of_target.contains(&set) {
            println!("cargo::rustc-cfg=compiled_{set}");
        } else {
            println!(
                "cargo::error={BUILD_SETS} is {asked:?}; give all or names among {}, parted by commas, or unset it for the \
                 best set of this machine",
                of_target.join(", ")
            );
        }
    }
}

/// Whether this machine has an instruction set, as `dispatch.rs` asks for it.
#[cfg(target_arch = "x86_64")]
fn has(set: &str) -> bool {
    let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    match set {
        "avx512" => {
            avx2 && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
        }
        "avx2" => avx2,
        _ => true,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn has(set: &str) -> bool {
    set == "plain"
}
