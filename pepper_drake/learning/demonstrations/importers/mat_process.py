"""A separate program that reads the LASA set's `demos` from a MATLAB file.

    python -I mat_process.py < motion.mat > arrays.npz

scipy's compiled reader crashes on some damaged files; here it only takes this process with it. The
exit code is `NO_DEMOS` for another MATLAB file, and 1 for a broken one, with a sentence on stderr.
"""

import io
import sys
import warnings
from typing import Any

import numpy as np
from scipy.io import loadmat

MOST = 100
"""Largest number of demonstrations read from a file."""
NO_DEMOS = 3


def main() -> int:
    """Reads from standard input, and writes arrays t0, pos0, t1, ... to standard output."""
    warnings.simplefilter("ignore")  # About variables that are not read.
    # The library's type hints lack streams and names of arrays.
    stream: Any = io.BytesIO(sys.stdin.buffer.read())
    arrays: dict[str, Any] = {}
    try:
        content = loadmat(stream, squeeze_me=True, struct_as_record=False)
        if "demos" not in content:
            return NO_DEMOS
        for k, demo in enumerate(np.atleast_1d(content["demos"])[:MOST]):
            arrays[f"t{k}"] = np.asarray(demo.t, dtype=float).ravel()
            arrays[f"pos{k}"] = np.asarray(demo.pos, dtype=float)
    except Exception as error:  # scipy may raise anything.
        sys.stderr.write(f"{type(error).__name__}: {' '.join(str(error).split())[:120]}")
        return 1
    written = io.BytesIO()
    np.savez(written, **arrays)
    sys.stdout.buffer.write(written.getvalue())
    return 0


if __name__ == "__main__":
    sys.exit(main())
