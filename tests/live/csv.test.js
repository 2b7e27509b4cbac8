import assert from "node:assert/strict";
import { test } from "node:test";
import { CSV_HEADER, csvLines } from "../../docs/live/csv.js";

test("each muon is a line with the columns of deepmuon-convert", () => {
    const text = csvLines({
        energy: Float32Array.of(1.5, 1000),
        direction: Float32Array.of(0, 0.6, -0.8, 0, 0, -1),
        charge: Int8Array.of(-1, 1),
    });
    assert.equal(CSV_HEADER, "kinetic_energy_GeV,u,v,w,pdg_id\n");
    assert.equal(text, "1.5,0,0.600000024,-0.800000012,13\n1000,0,0,-1,-13\n");
});

test("every float32 can be had again exactly", () => {
    const energy = Float32Array.from({ length: 10_000 }, (_, i) => 10 ** (i / 1250 - 3) * (1 + i / 7));
    const direction = new Float32Array(3 * energy.length).fill(-0.1);
    const charge = new Int8Array(energy.length).fill(1);
    const read = csvLines({ energy, direction, charge })
        .trim()
        .split("\n")
        .map((line) => Number(line.split(",")[0]));
    assert.deepEqual(Float32Array.from(read), energy);
});
