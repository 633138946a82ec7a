"""pysindy on residual tables: the kinds of the terms that are left; in an environment of its own.

Prints JSON: version, and the kinds of the active terms by optimiser and by the table's name.
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pysindy

THRESHOLDS = np.geomspace(1e-4, 0.1, 25)
MOST_TERMS = 5
FOLDS = 5


def terms(x, y, lagging):
    """Library of terms: (kind, values), the constants of each kind on a grid."""
    low, span = x.min(), np.ptp(x)
    yield "line", x
    yield "line", y
    for power in (-2.0, -1.0, -0.5, 0.5, 2.0, 3.0):
        yield "power", x**power
    for width in (0.15, 0.25, 0.35):
        yield "exponential", np.exp((x - x.max()) / (width * span))
    for width in (0.1, 0.2, 0.3):
        yield "saturation", 1.0 - np.exp(-(x - low) / (width * span))
    for place in (0.3, 0.4, 0.5, 0.6, 0.7):
        yield "threshold", np.maximum(x - low - place * span, 0.0)
    for values in lagging:
        yield "lag", values
    yield "product", x * y


def by_thresholds(matrix, target):
    """Coefficients by sequentially thresholded least squares, pysindy's default."""
    for threshold in THRESHOLDS:
        yield pysindy.STLSQ(threshold=threshold, alpha=1e-3).fit(matrix, target).coef_.ravel()


def forward(matrix, target):
    """Coefficients by forward regression with a few terms."""
    for count in range(1, MOST_TERMS + 1):
        yield pysindy.FROLS(max_iter=count).fit(matrix, target).coef_.ravel()


def compressed(matrix, target):
    """Triangular factor of the rows: the same inner products, and far fewer rows."""
    factor = np.linalg.qr(np.column_stack([matrix, target]), mode="r")
    return factor[:, :-1], factor[:, -1]


def active(matrix, target, fits):
    """Terms of the sparsest fit within a standard error of the best, by held-out spans."""
    fold = np.arange(len(target)) * FOLDS // len(target)
    errors = []
    for out in range(FOLDS):
        kept, held = fold != out, fold == out
        tried = fits(*compressed(matrix[kept], target[kept]))
        errors.append([np.mean((target[held] - matrix[held] @ one) ** 2) for one in tried])
    errors = np.array(errors)
    mean, error = errors.mean(axis=0), errors.std(axis=0, ddof=1) / np.sqrt(FOLDS)
    best = int(np.argmin(mean))
    near = mean <= mean[best] + error[best]
    tried = list(fits(*compressed(matrix, target)))
    sizes = [np.count_nonzero(o) if close else np.inf for o, close in zip(tried, near, strict=True)]
    return np.flatnonzero(tried[int(np.argmin(sizes))])


def kinds(path, fits):
    table = np.load(path)
    strong = table["strong"]
    library = list(terms(table["wind"], table["salt"], table["lagging"]))
    matrix = np.column_stack([values for _, values in library])[strong]
    matrix = (matrix - matrix.mean(axis=0)) / matrix.std(axis=0)
    target = table["factor"][strong]
    return sorted({library[term][0] for term in active(matrix, target - target.mean(), fits)})


def main():
    warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
    paths = sorted(Path(sys.argv[1]).glob("*.npz"))
    ways = {"thresholds": by_thresholds, "forward": forward}
    found = {way: {path.stem: kinds(path, fits) for path in paths} for way, fits in ways.items()}
    json.dump({"version": pysindy.__version__, "kinds": found}, sys.stdout)


if __name__ == "__main__":
    main()
