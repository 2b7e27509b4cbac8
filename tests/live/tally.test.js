import assert from "node:assert/strict";
import { test } from "node:test";
import { CosZenithBins, EnergyBins, Tally } from "../../docs/live/tally.js";

/**
 * @param {[number, number, number, number, number][]} rows energy, u, v, w, charge
 */
function tallyOf(...rows) {
    const tally = new Tally(0.001, 1e6);
    tally.add({
        energy: Float32Array.from(rows, ([energy]) => energy),
        direction: Float32Array.from(rows.flatMap(([, u, v, w]) => [u, v, w])),
        charge: Int8Array.from(rows, ([, , , , charge]) => charge),
    });
    return tally;
}

/** @param {number} energy */
function bin(energy) {
    const float = Float32Array.of(energy);
    return EnergyBins.index(float[0], new Uint32Array(float.buffer)[0]);
}

test("an energy is in the bin whose edges hold it", () => {
    for (let i = 0; i < 70; i++) {
        const [low, high] = EnergyBins.edges.slice(i, i + 2);
        assert.equal(bin(Math.sqrt(low * high)), i + 1);
        assert.equal(bin(low * 1.000001), i + 1);
        assert.equal(bin(high * 0.999999), i + 1);
    }
    assert.equal(bin(0.0099), 0);
    assert.equal(bin(1e-30), 0);
    assert.equal(bin(1.001e5), 71);
    assert.equal(bin(1e38), 71);
});

test("the vertical and the horizon are in the outermost bins", () => {
    assert.equal(CosZenithBins.index(1), 19);
    assert.equal(CosZenithBins.index(1.0000001), 19);
    assert.equal(CosZenithBins.index(1e-9), 0);
    assert.equal(CosZenithBins.index(0.52), 10);
});

test("muons are counted by energy, angle and charge", () => {
    const tally = tallyOf([1.1, 0, 0, -1, 1], [0.002, 0.6, 0, -0.8, -1], [2e5, 0, 0.6, -0.8, 1]);
    assert.equal(tally.count, 3);
    assert.equal(tally.unphysical, 0);
    assert.equal(tally.positive, 2);
    assert.ok(Math.abs(tally.energySum - 200001.102) < 1e-3);
    assert.deepEqual([tally.by_energy[0], tally.by_energy[21], tally.by_energy[71]], [1, 1, 1]);
    assert.deepEqual([tally.by_cos_zenith[15] + tally.by_cos_zenith[16], tally.by_cos_zenith[19]], [2, 1]);
});

test("what can't be a muon is counted apart", () => {
    const good = /** @type {const} */ ([1, 0, 0, -1, 1]);
    const bad = /** @type {[number, number, number, number, number][]} */ ([
        [0, 0, 0, -1, 1],
        [Number.NaN, 0, 0, -1, 1],
        [Number.POSITIVE_INFINITY, 0, 0, -1, 1],
        [0.0009, 0, 0, -1, 1],
        [1, 0, 0, 1, 1],
        [1, 1, 0, 0, 1],
        [1, 0, 0, -1.00001, 1],
        [1, Number.NaN, 0, -1, 1],
        [1, 0, 0, -1, 0],
    ]);
    const tally = tallyOf([...good], ...bad);
    assert.equal(tally.count, 10);
    assert.equal(tally.unphysical, bad.length);
    assert.equal(tally.energySum, 1);
});

test("the ends of the energy range belong to it, as float32", () => {
    assert.equal(tallyOf([0.001, 0, 0, -1, 1], [1e6, 0, 0, -1, 1]).unphysical, 0);
});
