import assert from "node:assert/strict";
import { test } from "node:test";
import { atDepth, SPHERE } from "../../docs/live/family.js";
import { depthAlong, familyAt, isFamily, shareOfRange } from "../../docs/live/models.js";
import { readDepth, readSize } from "../../docs/live/words.js";

/** @typedef {import("../../docs/live/models.js").Family} Family */

/**
 * A field of a Protocol Buffers message.
 *
 * @param {number} number
 * @param {number[]} content
 */
function field(number, content) {
    const { length } = content;
    assert.ok(length < 16384);
    const size = length < 128 ? [length] : [(length % 128) + 128, Math.floor(length / 128)];
    return [8 * number + 2, ...size, ...content];
}

/** @param {string} text */
function letters(text) {
    return [...new TextEncoder().encode(text)];
}

/**
 * A message with an initializer of each name and content.
 *
 * @param {[string, number[]][]} initializers
 */
function model(initializers) {
    const tensors = initializers.flatMap(([name, content]) =>
        field(5, [16, 1, ...field(8, letters(name)), ...content]),
    );
    return new Uint8Array([8, 9, ...field(7, [...field(2, letters("depth_m")), ...tensors])]).buffer;
}

for (const [kind, number] of /** @type {[string, number][]} */ ([
    ["raw bytes", 9],
    ["numbers", 4],
])) {
    test(`the four bytes of the depth change, stored as ${kind}, and nothing else`, () => {
        const before = model([
            ["depth", field(number, [1, 2, 3, 4])],
            ["depth_m", field(number, [0, 0, 32, 65])],
            ["depth_map", field(number, [5, 6, 7, 8])],
        ]);
        const after = atDepth(before, 13.7);
        const changed = [...after.keys()].filter((i) => after[i] !== new Uint8Array(before)[i]);
        const [first] = changed;
        assert.ok(changed.length > 0 && changed.every((i) => i < first + 4));
        assert.ok([...after].join().includes([0x33, 0x33, 0x5b, 0x41].join()));
        assert.deepEqual([...atDepth(after.buffer, 10)], [...new Uint8Array(before)]);
    });
}

for (const [kind, content, expected] of /** @type {[string, number[], number[]][]} */ ([
    ["raw bytes", field(9, [0, 0, 0, 0]), [1, 0, 0, 0]],
    ["a packed number", field(5, [0]), [1]],
])) {
    test(`a sphere is asked for in the surface, stored as ${kind}`, () => {
        const depth = field(9, [0, 0, 32, 65]);
        const before = model([
            ["depth_m", depth],
            ["surface", content],
        ]);
        const after = model([
            ["depth_m", depth],
            ["surface", [...content.slice(0, 2), ...expected]],
        ]);
        assert.deepEqual([...atDepth(before, 10, SPHERE)], [...new Uint8Array(after)]);
        assert.deepEqual([...atDepth(before, 10)], [...new Uint8Array(before)]);
    });
}

test("a family without a sphere is told in words", () => {
    const plane = model([["depth_m", field(9, [0, 0, 32, 65])]]);
    assert.throws(() => atDepth(plane, 10, SPHERE), /no muons of a sphere/);
});

test("what is no family is told in words", () => {
    const number = field(9, [0, 0, 32, 65]);
    for (const initializers of /** @type {[string, number[]][][]} */ ([
        [],
        [["depth", number]],
        [["depth_m", field(9, [1, 2, 3])]],
        [
            ["depth_m", number],
            ["depth_m", number],
        ],
    ])) {
        assert.throws(() => atDepth(model(initializers), 10), /no family/);
    }
    assert.throws(() => atDepth(new Uint8Array([58, 200, 1, 3]).buffer, 10), /cut off/);
    assert.throws(() => atDepth(new Uint8Array([58, 200]).buffer, 10), /cut off/);
    assert.throws(() => atDepth(new Uint8Array([59, 1]).buffer, 10), /cut off/);
});

const family = /** @type {Family} */ (
    /** @type {unknown} */ ({
        depth_m: 10,
        depth_min_m: 0,
        depth_max_m: 100,
        rates: [
            [0, 110],
            [10, 56],
            [100, 2.5],
        ],
    })
);

test("a slider's way through the range goes there and back, in three digits", () => {
    assert.equal(depthAlong(family, 0), 0);
    assert.equal(depthAlong(family, 1), 100);
    let last = -1;
    for (let share = 0; share <= 1; share += 0.01) {
        const depth = depthAlong(family, share);
        assert.ok(depth > last, `${depth} after ${last}`);
        assert.ok(Math.abs(shareOfRange(family, depth) - share) < 0.005);
        last = depth;
    }
});

test("the rate at a depth is the known one there, and lies between its neighbours' elsewhere", () => {
    for (const [depth, rate] of family.rates) {
        assert.ok(Math.abs(familyAt(family, depth).rate_hz_per_m2 / rate - 1) < 1e-12);
    }
    const between = familyAt(family, 20);
    assert.ok(between.rate_hz_per_m2 < 56 && between.rate_hz_per_m2 > 2.5);
    assert.equal(between.depth_m, 20);
    assert.ok(isFamily(between) && !isFamily({ ...family, depth_min_m: null }));
});

test("a depth is read in metres, within its range", () => {
    for (const [text, depth] of /** @type {[string, number][]} */ ([
        ["13.7", 13.7],
        [" 0 ", 0],
        ["100 m", 100],
        [".5", 0.5],
        ["7.", 7],
    ])) {
        assert.equal(readDepth(text, 0, 100), depth);
    }
    for (const text of ["", "deep", "-1", "100.1", "1e1", "1,5", "NaN"]) {
        assert.throws(() => readDepth(text, 0, 100), /How deep\? From 0 to 100 m/);
    }
});

test("a size of a target is read in metres, from a hand's breadth to a house", () => {
    assert.deepEqual(["4", " 0.1 m ", "10"].map(readSize), [4, 0.1, 10]);
    for (const text of ["", "0", "-1", "0.09", "10.1", "1e1", "NaN"]) {
        assert.throws(() => readSize(text), /How large\? From 0.1 to 10 m/);
    }
});
