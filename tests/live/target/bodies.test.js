import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { test } from "node:test";
import { bodyOf } from "../../../docs/live/target/bodies.js";
import { evenPoints } from "../../../docs/live/target/points.js";

const PYTHON = process.env.PYTHON ?? "python";

/** @typedef {import("../../../docs/live/target/bodies.js").Kind} Kind */
/** @typedef {{hits: boolean[], places: number[][], areas: number[], rows: number[][], largest_area: number, height: number}} Answers */

/**
 * Directions and numbers, and what the package makes of them.
 *
 * @param {Kind} kind
 * @param {number[]} sizes
 * @returns {Answers}
 */
function answersOfPackage(kind, sizes) {
    const program = `
import json
import numpy as np
from deepmuon_runtime.targets.by_name import target_of
rng = np.random.default_rng(1)
rows = 2 * rng.random((2000, 6)) - 1
rows[:, 2] = -np.abs(rows[:, 2])
rows[:, :3] /= np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
rows[0, :3] = 0, 0, -1
rows = rows.astype(np.float32)
target = target_of("${kind}", ${JSON.stringify(sizes)})
u, v, w = rows[:, :3].T
entries = target.enters(u, v, w, rows[:, 3:])
print(json.dumps({
    "rows": rows.tolist(),
    "areas": target.projected_area(u, v, w).tolist(),
    "largest_area": target.largest_area,
    "height": target.vertical_size,
    "hits": entries.hits.tolist(),
    "places": np.stack([entries.x, entries.y, entries.z], axis=1).tolist(),
}))`;
    return JSON.parse(execFileSync(PYTHON, ["-c", program], { encoding: "utf-8", maxBuffer: 1e9 }));
}

for (const [kind, ...sizes] of /** @type {[Kind, ...number[]][]} */ ([
    ["box", 4, 3, 2],
    ["box", 0.1, 5, 10],
    ["cylinder", 2, 3],
    ["cylinder", 0.1, 10],
    ["sphere", 2.5],
])) {
    test(`a ${kind} of ${sizes.join(" x ")} m has the shadows and the entries of the package`, () => {
        const body = bodyOf(kind, sizes);
        const { rows, areas, largest_area, height, hits, places } = answersOfPackage(kind, sizes);
        assert.ok(Math.abs(body.largestArea / largest_area - 1) < 1e-12);
        assert.equal(body.height, height);
        let otherwise = 0;
        for (const [i, [u, v, w, a, b, c]] of rows.entries()) {
            assert.ok(Math.abs(body.projectedArea(u, v, w) / areas[i] - 1) < 1e-5, `area ${i}`);
            const place = body.enters(u, v, w, a, b, c);
            if ((place !== undefined) !== hits[i]) otherwise += 1;
            else if (place) {
                const off = Math.max(...place.map((coordinate, axis) => Math.abs(coordinate - places[i][axis])));
                assert.ok(off < 1e-5 * body.reach, `place ${i} is off by ${off} m`);
            }
        }
        assert.ok(otherwise <= 1, `${otherwise} hits differ`); // rounding decides at the very edge
    });
}

test("even points integrate the shadows of an even sky to the mean of a convex body, a fourth of its surface", () => {
    const number = 1 << 16;
    const points = evenPoints(number, 2);
    for (const [kind, sizes, surface] of /** @type {[Kind, number[], number][]} */ ([
        ["box", [4, 3, 2], 2 * (12 + 8 + 6)],
        ["cylinder", [2, 3], 2 * Math.PI * 2 * (2 + 3)],
        ["sphere", [2], 4 * Math.PI * 4],
    ])) {
        const body = bodyOf(kind, sizes);
        let sum = 0;
        for (let i = 0; i < points.length; i += 2) {
            const w = -(1 + points[i]) / 2;
            const sine = Math.sqrt(1 - w * w);
            const azimuth = Math.PI * points[i + 1];
            sum += body.projectedArea(sine * Math.cos(azimuth), sine * Math.sin(azimuth), w);
        }
        assert.ok(Math.abs(sum / number / (surface / 4) - 1) < 1e-4, kind);
    }
});

test("even points are inside the latents' range", () => {
    assert.ok(evenPoints(100_000, 5).every((number) => Math.abs(number) < 1));
});
