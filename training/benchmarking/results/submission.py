"""A result packed for the leaderboards: checked, and without any code in it."""

import hashlib
import io
import json
import zipfile
from pathlib import Path

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import read_bytes
from poise.configs.schema import to_dict
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.running.files import SETTINGS, SUMMARY, TRIALS

from .read import Results, load_results

PACKED = (SETTINGS, TRIALS, SUMMARY)
MANIFEST = "submission.json"
MOST_BYTES = 256 * 2**20  # of a file
SUITES = ("standard", "standard-wide", "wide-grid", "walkers", "realistic", "scenarios")
EPOCH = (1980, 1, 1, 0, 0, 0)  # of every member: the same result gives the same bytes


def pack_submission(folder: str | Path) -> Path:
    """Check the folder of a result and pack it into ``FOLDER.zip``; returns that file.

    The archive holds settings.yaml, trials.csv, summary.json and submission.json, which has the
    sums (sha256) of these and the suite. No other file of the folder is included.

    Raises:
        ConfigError: as `load_results`; a suite that no leaderboard is of, or not as it is packaged;
            a controller that raised an error; a file above 256 MiB.
        PoiseError: the archive cannot be written.
    """
    results = load_results(folder)
    _check(results)
    files = {name: read_bytes(results.folder / name, MOST_BYTES) for name in PACKED}
    settings = results.settings
    manifest = {
        "suite": settings.suite_name,
        "robot": settings.robot,
        "robot_fingerprint": settings.robot_fingerprint,
        "seed": settings.seed,
        "versions": settings.versions,
        "controllers": settings.controllers,
        "trials": {name: len(results.of(name)) for name in results.controllers},
        "sha256": {name: hashlib.sha256(data).hexdigest() for name, data in files.items()},
    }
    files[MANIFEST] = (json.dumps(manifest, indent=1) + "\n").encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, EPOCH), data, zipfile.ZIP_DEFLATED)
    out = results.folder.resolve().with_suffix(".zip")
    write_atomic(out, packed.getvalue())
    return out


def _check(results: Results) -> None:
    settings, folder = results.settings, results.folder
    if settings.suite_name not in SUITES:
        raise ConfigError("no leaderboard is of this suite", source=folder / SETTINGS,
                          field="suite_name", choices=SUITES)  # fmt: skip
    if to_dict(load_suite(settings.suite_name)) != settings.suite:
        why = f"is not {settings.suite_name} as it is packaged: run it without --trials"
        raise ConfigError(why, source=folder / SETTINGS, field="suite")
    for record in results.records:
        if record.error:
            raise ConfigError(f"{record.controller} raised an error in trial {record.trial}",
                              source=folder / TRIALS, field="error")  # fmt: skip
