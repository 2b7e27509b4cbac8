import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { test } from "node:test";
import * as ort from "onnxruntime-web/wasm";
import { atDepth, SPHERE } from "../../docs/live/family.js";
import { Split } from "../../docs/live/split.js";

const PYTHON = process.env.PYTHON ?? "python";

ort.env.wasm.numThreads = 1;

/**
 * A small family.
 *
 * @param {string} options
 */
function tinyFamily(options) {
    const program = `
import sys
sys.path.insert(0, "tests")
from support.tiny_families import tiny_family
sys.stdout.buffer.write(tiny_family(${options}))`;
    const file = execFileSync(PYTHON, ["-c", program], { cwd: new URL("../..", import.meta.url) });
    return new Uint8Array(file).buffer;
}

/** @param {Uint8Array} file */
function open(file) {
    return ort.InferenceSession.create(file, { executionProviders: ["wasm"] });
}

/**
 * @param {number} depth
 * @param {number} surface
 */
function placeOf(depth, surface) {
    return {
        depth_m: new ort.Tensor("float32", Float32Array.of(depth), []),
        surface: new ort.Tensor("int32", Int32Array.of(surface), []),
    };
}

for (const [kind, options] of [
    ["raw bytes", ""],
    ["numbers", "raw=False"],
]) {
    test(`the parts of a family, stored as ${kind}, give its muons and rates bit by bit at any depth`, async () => {
        const family = tinyFamily(options);
        const split = new Split(family);
        const tables = await open(split.modelOfTables());
        const muons = await open(split.modelOfMuons(await tables.run(placeOf(10, 0))));
        assert.ok(!muons.outputNames.includes("rate_hz_per_m2"));
        const latent = Float32Array.from({ length: 4 * 999 }, (_, i) => Math.sin(1.7 * i));
        const feeds = { latent: new ort.Tensor("float32", latent, [999, 4]) };
        for (const [depth, surface] of [
            [13.7, 0],
            [13.7, SPHERE],
            [80, 0],
        ]) {
            const made = await tables.run(placeOf(depth, surface));
            const needed = muons.inputNames.filter((name) => name !== "latent").map((name) => [name, made[name]]);
            assert.ok(needed.length > 0);
            const parts = { ...(await muons.run({ ...feeds, ...Object.fromEntries(needed) })), ...made };
            const whole = await (await open(atDepth(family, depth, surface))).run(feeds);
            for (const [name, { data }] of Object.entries(whole)) assert.deepEqual(parts[name].data, data, name);
        }
    });
}

test("a family without a sphere is asked for a depth alone", async () => {
    const tables = await open(new Split(tinyFamily("has_sphere=False")).modelOfTables());
    assert.deepEqual([...tables.inputNames], ["depth_m"]);
});
