//! Chooses the instruction sets that are compiled: those of this machine, or all of the architecture.
//!
//! All are compiled with the feature `all-sets`, where `MRWORK_BUILD_SETS` is `all`, and for another target than this
//! machine; plain alone where it is `plain`, which builds soonest. Else a build from source is for the machine that it
//! stands on: its best set, AVX2 and plain.

/// Environment variable that asks for `all` sets, or for `plain` alone.
const BUILD_SETS: &str = "MRWORK_BUILD_SETS";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed={BUILD_SETS}");
    println!("cargo::rustc-check-cfg=cfg(compiled_avx512, compiled_avx2)");
    let variable = |name: &str| std::env::var(name).unwrap_or_default();
    if variable("CARGO_CFG_TARGET_ARCH") != "x86_64" {
        return;
    }
    let asked = variable(BUILD_SETS);
    if !["", "all", "plain"].contains(&asked.as_str()) {
        println!(
            "cargo::error={BUILD_SETS} is {asked:?}; give all or plain, or unset it for the sets of this machine"
        );
    }
    let all = std::env::var_os("CARGO_FEATURE_ALL_SETS").is_some()
        || asked == "all"
        || variable("HOST") != variable("TARGET");
    let [avx512, avx2] = if asked == "plain" { [false; 2] } else { of_this_machine() };
    if all || avx512 {
        println!("cargo::rustc-cfg=compiled_avx512");
    }
    if all || avx2 {
        println!("cargo::rustc-cfg=compiled_avx2");
    }
}

/// Whether this machine has AVX-512 and AVX2, as `dispatch.rs` asks for them.
#[cfg(target_arch = "x86_64")]
fn of_this_machine() -> [bool; 2] {
    let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    [avx2 && avx512, avx2]
}

#[cfg(not(target_arch = "x86_64"))]
fn of_this_machine() -> [bool; 2] {
    [false; 2]
}
