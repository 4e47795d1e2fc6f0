"""What every executor computes: digests of a choice of models, of a tuning and of a study; also a program for MPI."""

import sys
from concurrent.futures import Executor
from pathlib import Path
from tempfile import TemporaryDirectory

import mrwork as mr
import mrwork.cli
from mrwork.store.codec import digest_of

STUDY = Path(mrwork.cli.__file__).parent / "samples" / "study.toml"


def digests(executor: Executor | None) -> list[str]:
    """Digests of fits and ranking, of tuned settings with what they are judged, and of the criteria of a study."""
    choice = mr.choose_model(mr.synthetic_test("spencer1997"), ["dahl", "bingham"], executor=executor)
    with TemporaryDirectory() as folder:
        short = Path(folder) / "study.toml"
        short.write_text(STUDY.read_text().replace("15 s", "4 s"))
        study = mr.read_study(short)
    tuned = mr.tune(study, laws=["clipped_optimal"], rng=1, budget=24, executor=executor)
    criteria = mr.run_study(study, executor=executor and mr.Workers(executor, 3)).criteria_of_runs.numbers
    return [
        digest_of(*((fit.theta, fit.nrmse, fit.remarks) for fit in choice.fits), choice.ranking.sentence),
        digest_of(*((law.settings, law.least) for law in tuned.laws)),
        digest_of(*(criteria[name] for name in sorted(criteria))),
    ]


if __name__ == "__main__":
    from mpi4py.futures import MPIPoolExecutor

    with MPIPoolExecutor() as ranks:
        Path(sys.argv[1]).write_text("\n".join(digests(ranks)))
