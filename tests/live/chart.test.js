import assert from "node:assert/strict";
import { test } from "node:test";
import { linearAxis, logAxis, roundAxis } from "../../docs/live/chart.js";

test("a logarithmic axis has a tick at each power of ten", () => {
    const { ticks, place } = logAxis("E", -3, 5);
    assert.deepEqual(
        ticks.map(({ label }) => label),
        ["10⁻³", "0.01", "0.1", "1", "10", "100", "1000", "10⁴", "10⁵"],
    );
    assert.equal(place(1e-3), 0);
    assert.equal(place(1e5), 1);
    assert.equal(place(10), 0.5);
});

test("a linear axis begins at 0", () => {
    const { ticks, place } = linearAxis("cos", 1, 0.2);
    assert.deepEqual(
        ticks.map(({ label }) => label),
        ["0", "0.2", "0.4", "0.6", "0.8", "1"],
    );
    assert.equal(place(0.25), 0.25);
});

test("a round axis shows the largest value with three to seven ticks", () => {
    for (let largest = 0.013; largest < 1e4; largest *= 1.37) {
        const { ticks, place } = roundAxis("y", largest);
        assert.ok(place(largest) <= 1 && place(largest) > 0.5, `${largest}`);
        assert.ok(ticks.length >= 3 && ticks.length <= 7, `${largest}: ${ticks.length}`);
        assert.ok(Math.abs(place(/** @type {any} */ (ticks.at(-1)).value) - 1) < 1e-12);
    }
});
