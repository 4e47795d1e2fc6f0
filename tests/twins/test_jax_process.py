"""What the operation shares with its process: the state of the processor, pools of threads, the cache of programs."""

import os
import sys
from pathlib import Path

from command_line import ran

# Its derivatives have subnormal numbers, which XLA's threads flush to zero.
_TASK = """
import sys
import numpy as np
import mrwork as mr
time = 1e-3 * np.arange(300)
motion = mr.Loading(dt=1e-3, displacement=0.01 * np.sin(15.0 * time))
spec = mr.damper("normalised_bouc_wen")
theta = np.array(spec.nominal) * np.linspace(0.9, 1.1, 64)[:, None]
def core(threads):
    found = mr.sensitivities(spec, theta, motion, threads=threads)
    return found.force.tobytes(), found.jacobian.tobytes()
"""
_THREADS = f"""{_TASK}
import jax
from mrwork.twins.kernel import Kernel, _linearise
from mrwork.twins.record_arrays import RecordArrays
record = RecordArrays.of(motion.history())
# The pool of two threads is first started by a thread of XLA.
force, jacobian = _linearise(
    Kernel(spec=spec, columns=(*range(len(spec.names)),), threads=2), jax.numpy.asarray(theta), record
)
after, alone = core(2), core(1)
subnormal = np.frombuffer(alone[1])
assert (np.abs(subnormal[subnormal != 0.0]) < np.finfo(float).tiny).any()
assert after == alone
assert np.asarray(force).tobytes() == alone[0]
assert np.moveaxis(np.asarray(jacobian), 1, 2).tobytes() == alone[1]
# XLA's thread has its own state again.
assert float(jax.jit(lambda x: x * 0.5)(np.finfo(float).tiny)) == 0.0
"""
_CACHED = f"""{_TASK}
import hashlib, jax
force = mr.jax.force(spec, motion)
found = jax.jit(jax.vmap(force, (0, None)))(theta, force.data)
for each in (np.asarray(found).tobytes(), core(1)[0]):
    print(hashlib.sha256(each).hexdigest())
"""


def test_threads_and_the_state_of_the_processor_are_as_without_it() -> None:
    run = ran(sys.executable, "-c", _THREADS)
    assert run.returncode == 0, run.stderr


def test_processes_share_a_cache_of_compiled_programs(tmp_path: Path) -> None:
    cache = {
        "JAX_COMPILATION_CACHE_DIR": str(tmp_path),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "0",
    }
    runs, programs = [], []
    for _ in range(2):
        run = ran(sys.executable, "-c", _CACHED, env={**os.environ, **cache})
        assert run.returncode == 0, run.stderr
        runs.append(run.stdout.split())
        programs.append({file.name for file in tmp_path.iterdir() if not file.name.endswith("-atime")})
    assert len({digest for run in runs for digest in run}) == 1
    assert programs[0] == programs[1] != set()
