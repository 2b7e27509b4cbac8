import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { FOR_PLACES, Latents, modelStream, newSeed, readSeed } from "../../docs/live/latents.js";

const bytes = await readFile(new URL("../../docs/live/engine/random.wasm", import.meta.url));
const latents = await Latents.open(bytes);

test("Philox gives the known answers of Random123", () => {
    const { philox } = /** @type {any} */ (latents.module);
    const words = [0x16554d9eca36314cn, 0xdb20fe9d672d0fdcn, 0xd7e772cee186176bn, 0x7e68b68aec7ba23bn];
    assert.deepEqual(
        philox(0n, 0n, 0n, 0n).map((/** @type {bigint} */ word) => BigInt.asUintN(64, word)),
        words,
    );
});

test("latents are odd multiples of 2^-24 inside (-1, 1), and look uniform", () => {
    const drawn = latents.draw(2n ** 64n - 1n, 2n ** 64n - 1n, 0, 80_000, 5);
    let [sum, squares] = [0, 0];
    for (const latent of drawn) {
        assert.ok(Math.abs(latent) < 1 && Math.abs((latent * 2 ** 24) % 2) === 1);
        sum += latent;
        squares += latent ** 2;
    }
    // Five standard errors, with a fixed seed.
    assert.ok(Math.abs(sum / drawn.length) < 5 * Math.sqrt(1 / 3 / drawn.length));
    assert.ok(Math.abs(squares / drawn.length - 1 / 3) < 5 * Math.sqrt(4 / 45 / drawn.length));
});

test("a draw has the same latents wherever the batch begins", () => {
    const long = latents.draw(7n, 5n, 0, 64, 356).slice();
    assert.deepEqual(latents.draw(7n, 5n, 24, 40, 356).slice(), long.slice(24 * 356));
});

test("what is for places has nothing in common with what is for muons", () => {
    const ofMuons = new Set(latents.draw(7n, 5n, 0, 64, 3));
    assert.ok(latents.draw(7n, 5n, 0, 64, 3, FOR_PLACES).every((number) => !ofMuons.has(number)));
});

test("seeds and streams differ in every bit of theirs", () => {
    const ends = [0n, 1n, 2n ** 32n, 2n ** 63n, 2n ** 64n - 1n];
    const drawn = ends.flatMap((seed) => ends.map((stream) => latents.draw(seed, stream, 0, 8, 1).join()));
    assert.equal(new Set(drawn).size, ends.length ** 2);
});

test("streams are those of the documentation", async () => {
    const page = await readFile(new URL("../../docs/random_numbers.md", import.meta.url), "utf-8");
    const rows = [...page.matchAll(/^\| `(.*)\/(.*)\/(.*)\/0\/` \| (\S+) \| `(0x[0-9a-f]{16})` \|$/gm)];
    assert.ok(rows.length >= 4);
    for (const [, architecture, flux, medium, depth, stream] of rows) {
        assert.equal(modelStream({ architecture, flux, medium, depth_m: Number(depth) }), BigInt(stream));
    }
});

test("a seed is a whole number of 64 bits", () => {
    assert.equal(readSeed(" 18446744073709551615 "), 2n ** 64n - 1n);
    for (const text of ["18446744073709551616", "-1", "1e3", "0x10", "one", ""]) {
        assert.throws(() => readSeed(text), RangeError, text);
    }
    assert.ok(newSeed() < 2n ** 63n && newSeed() !== newSeed());
});
