"""How often intervals of fitted weights of a running cost contain the planted ones.

    python benchmarks/planted_weights.py [--count 20] [--resamples 60] [--arm]

Each count is a synthetic recording of 20 motions of least cost between random configurations and
velocities, with noise of 3 mrad, of a planar arm or of the human arm (slow).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import geodesic_ocp as go

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from fitting.synthetic import optimal_recording
from fitting.test_fit_metric import PLANAR

WEIGHTS = {"energy": 0.3, "acceleration": 0.4, "torque change": 0.2, "jerk": 0.1}


def main() -> None:
    """Print means, scatter, standard errors, and shares of intervals with the planted weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--resamples", type=int, default=60)
    parser.add_argument("--arm", action="store_true")
    options = parser.parse_args()
    model = go.load_model(PLANAR, hand="hand")
    if options.arm:
        model = go.human_arm()
        model = model.with_armature(go.manifold.default_joint_inertia(model))
    values, found, errors, inside = np.array([*WEIGHTS.values()]), [], [], []
    for seed in range(options.count):
        rng = np.random.default_rng(seed)
        recording, segments = optimal_recording(
            go.KineticEnergy(model), model, rng, WEIGHTS, noise=0.003
        )
        fit = go.fitting.fit_cost(
            recording, metric=go.KineticEnergy, segments=[segments], free_ends=True
        )
        found.append(fit.weights)
        errors.append(fit.standard_errors)
        if options.resamples:
            intervals = go.fitting.bootstrap_cost(fit, options.resamples, seed=seed)
            pairs = zip(intervals, values, strict=True)
            inside.append([each.low <= value <= each.high for each, value in pairs])
    print("planted         ", values)
    print("mean            ", np.mean(found, axis=0).round(4))
    print("scatter         ", np.std(found, axis=0, ddof=1).round(4))
    print("standard error  ", np.mean(errors, axis=0).round(4))
    near = np.abs(np.array(found) - values) < 1.96 * np.array(errors)
    print("within 1.96 s.e.", near.mean(axis=0))
    if inside:
        print("in 95 % bootstrap", np.mean(inside, axis=0))


if __name__ == "__main__":
    main()
