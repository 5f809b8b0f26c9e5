"""Coverage-guided fuzzing of the parsers, one process each: `make fuzz`, or `python -m tests.fuzz.guided --help`.

A file that reaches lines not reached before is kept in the corpus, from which the next run goes on. A file that a
parser neither reads nor refuses in a sentence is kept as crash-..., one that hangs as timeout-..., one that takes too
much memory as oom-...
"""

import argparse
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from tempfile import TemporaryDirectory

from perception import kernels
from tests.fuzz.parsers import PARSERS
from tests.fuzz.refusal import place, refusal

MAX_MEMORY_MB = 1536  # of the whole process, libraries included
MAX_SECONDS = 20
MAX_FILE_BYTES = 1 << 16
_LIBRARIES = ("data", "perception", "train")


def main() -> int:
    """Fuzz the parsers that are named, all without names; exit with 1 where a fault was found."""
    words = argparse.ArgumentParser(prog="python -m tests.fuzz.guided", description=__doc__)
    words.add_argument("parsers", nargs="*", metavar="PARSER", help=", ".join(PARSERS))
    words.add_argument("--runs", type=int, default=20_000, help="executions of each parser")
    words.add_argument("--out", type=Path, default=Path("results/fuzz"), help="corpus and faults")
    words.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    flags = words.parse_args()
    if unknown := sorted({*flags.parsers} - {*PARSERS}):
        words.error(f"no parser {', '.join(unknown)}; known are {', '.join(PARSERS)}")
    if flags.here:
        _fuzz(flags.parsers[0], flags.runs, flags.out)
    found = []
    for name in flags.parsers or PARSERS:
        command = [sys.executable, "-m", "tests.fuzz.guided", name, "--here"]
        done = subprocess.run(
            [*command, "--runs", str(flags.runs), "--out", str(flags.out)],
            check=False,
            stderr=subprocess.PIPE,
            text=True,
        )
        last = [line for line in done.stderr.splitlines() if line.startswith(("Done", "#"))][-1:]
        print(f"{name:18} {'fault' if done.returncode else 'ok':6} {''.join(last)}", flush=True)
        if done.returncode:
            found.append(name)
            (flags.out / name / "fault.log").write_text(done.stderr)
    if found:
        print(f"faults in {', '.join(found)}: see {flags.out}/PARSER/fault.log")
    return 1 if found else 0


def _fuzz(name: str, runs: int, out: Path) -> None:
    """Fuzz one parser; the fuzzer ends the process."""
    import atheris

    for module in iter_modules(
        kernels.__path__
    ):  # numba compiles what is written there, and nothing that is added
        import_module(f"{kernels.__name__}.{module.name}")
    with atheris.instrument_imports(include=[*_LIBRARIES]):
        for library in _LIBRARIES:
            __import__(library)
    parser = PARSERS[name]
    corpus = out / name / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        path = place(parser, Path(folder))
        with atheris.instrument_imports(include=[*_LIBRARIES]):
            for number, seed in enumerate(parser.seeds()):
                (corpus / f"seed-{number}").write_bytes(seed)
                refusal(parser, path, seed)  # imports what the parser needs
        options = {
            "runs": runs,
            "max_len": MAX_FILE_BYTES,
            "timeout": MAX_SECONDS,
            "rss_limit_mb": MAX_MEMORY_MB,
            "artifact_prefix": f"{out / name}/",
            "seed": 1,
        }
        words = [f"-{key}={value}" for key, value in options.items()]
        atheris.Setup([sys.argv[0], *words, str(corpus)], lambda data: refusal(parser, path, data))
        atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
