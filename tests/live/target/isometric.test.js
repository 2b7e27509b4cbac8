import assert from "node:assert/strict";
import { test } from "node:test";
import { bodyOf } from "../../../docs/live/target/bodies.js";
import { ENLARGED, isSeen, outlineOf, projected } from "../../../docs/live/target/isometric.js";

/** @typedef {import("../../../docs/live/target/bodies.js").Kind} Kind */

/** @type {[Kind, number[]][]} */
const BODIES = [
    ["box", [4, 3, 2]],
    ["cylinder", [2, 3]],
    ["sphere", [2.5]],
];

test("a metre along each axis is a metre of the drawing, at 120 degrees to the others", () => {
    const axes = [projected([1, 0, 0]), projected([0, 1, 0]), projected([0, 0, 1])];
    for (const [i, [right, down]] of axes.entries()) {
        assert.ok(Math.abs(Math.hypot(right, down) - 1) < 1e-12);
        const [nextRight, nextDown] = axes[(i + 1) % 3];
        assert.ok(Math.abs(right * nextRight + down * nextDown + 1 / 2) < 1e-12);
    }
    assert.ok(axes[2][1] < 0, "z is up");
});

test("a sphere's rim is a circle", () => {
    const [rim] = outlineOf(bodyOf("sphere", [2.5])).seen;
    for (const corner of rim) assert.ok(Math.abs(Math.hypot(...projected(corner)) - 2.5 * ENLARGED) < 1e-9);
});

test("outlines lie on their bodies, and hold what enters them", () => {
    for (const [kind, sizes] of BODIES) {
        const body = bodyOf(kind, sizes);
        const { seen, hidden } = outlineOf(body);
        const outline = seen.flat().map(projected);
        for (const corner of [...seen, ...hidden].flat()) {
            assert.ok(Math.hypot(...corner) <= body.reach * (1 + 1e-9), kind);
            assert.ok(Math.hypot(...corner) >= Math.min(...sizes) / 2 - 1e-9, kind);
        }
        for (let a = -0.95; a < 1; a += 0.1) {
            for (let b = -0.95; b < 1; b += 0.1) {
                const place = body.enters(0.48, -0.6, -0.64, a, b, -b * a);
                if (!place) continue;
                const [right, down] = projected(place);
                for (let turn = 0; turn < 64; turn++) {
                    const [x, y] = [Math.cos((turn / 32) * Math.PI), Math.sin((turn / 32) * Math.PI)];
                    const farthest = Math.max(...outline.map(([right, down]) => x * right + y * down));
                    assert.ok(x * right + y * down <= farthest * 1.002, `${kind}, ${place}`); // its arcs are polygons
                }
            }
        }
    }
});

test("the top is seen, and of the sides those towards the eye", () => {
    for (const [kind, sizes] of BODIES) {
        const body = bodyOf(kind, sizes);
        const straightDown = body.enters(0, 0, -1, -0.999, 0.1, -0.9);
        assert.ok(straightDown && isSeen(body, straightDown), kind);
        for (const [u, seen] of /** @type {[number, boolean][]} */ ([
            [-0.9, true],
            [0.9, false],
        ])) {
            const w = -Math.sqrt(1 - u * u);
            // The number of a side, and a place in its middle.
            const place = body.enters(u, 0, w, 0.2, 0, kind === "sphere" ? -1 : 0);
            assert.ok(place && isSeen(body, place) === seen, `${kind}, ${u}, ${place}`);
        }
    }
});
