"""How fast is mrwork beside the best that other libraries make of the same job?

`speed.py SUBJECT` runs `speed_SUBJECT.py` once for each number of threads, in a process of its own on as many cores,
since jax and numba size their thread pools when they are imported. Ratios count: seconds depend on the machine and its
load. Each peer runs in the fastest settings that were found, results must agree before anything is timed, and compiling
is not timed. The peers come with the extra `bench`. Where `MRWORK_INSTRUCTION_SET` is avx2, peers are held to it too.
Minutes.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

SUBJECTS = {  # with numbers of threads
    "kernels": [1, 2],
    "models": [1],
    "loop": [1, 2],
    "formulas": [1],
    "identify": [1],
    "posterior": [1],
    "regulators": [1, 2],
}
# A processor without AVX-512; its name alone would leave numba the features of this machine, AVX-512 among them.
PEERS_HELD = {
    "avx2": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "", "XLA_FLAGS": "--xla_cpu_max_isa=AVX2"}
}
POOLS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS", "JAX_NUM_CPU_DEVICES")

more = "further options are those of speed_SUBJECT.py --help"
parser = argparse.ArgumentParser(prog="speed.py", description=__doc__, epilog=more)
parser.add_argument("subject", choices=SUBJECTS)
parser.add_argument("--threads", type=int, nargs="+", metavar="N", help="one number after another")
parser.add_argument("--quick", action="store_true", help="tiny sizes on one thread, some seconds")
parser.add_argument("--json", action="store_true", help="one JSON object with the `rows` of all threads")
options, others = parser.parse_known_args()
pinning = hasattr(os, "sched_setaffinity")
cores = sorted(os.sched_getaffinity(0)) if pinning else list(range(os.cpu_count() or 1))
usual = [1] if options.quick else [count for count in SUBJECTS[options.subject] if count <= len(cores)]
counts = options.threads or usual
if not 1 <= min(counts) <= max(counts) <= len(cores):
    parser.error(f"--threads {counts}: this machine has {len(cores)} core(s); give 1 to {len(cores)}")

found, status = {"rows": [], "departures": []}, 0
for count in counts:
    script = Path(__file__).with_name(f"speed_{options.subject}.py")
    command = [sys.executable, script, "--threads", str(count), *others]
    command += ["--quick"] * options.quick + ["--json"] * options.json
    held = PEERS_HELD.get(os.environ.get("MRWORK_INSTRUCTION_SET", ""), {})
    environment = held | os.environ | dict.fromkeys(POOLS, str(count)) | {"JAX_PLATFORMS": "cpu"}
    out = subprocess.PIPE if options.json else None
    if pinning:  # as the process that is started
        os.sched_setaffinity(0, cores[:count])
    run = subprocess.run(command, env=environment, stdout=out, check=False)
    if pinning:
        os.sched_setaffinity(0, cores)
    status = max(status, run.returncode)
    if options.json and run.stdout:
        tables = json.loads(run.stdout)
        found["rows"] += tables.pop("rows").values()
        found["departures"] += tables.pop("departures")
        found |= tables
if found["rows"]:
    print(json.dumps(found))
sys.exit(status)
