import assert from "node:assert/strict";
import { test } from "node:test";
import { atDepth, SPHERE } from "../../docs/live/family.js";
import { depthAlong, depthBeside, familyAt, isFamily, marksAlong, shareOfRange } from "../../docs/live/models.js";
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
        held_out_at: [[10, { by_energy: [1], by_cos_zenith: [2] }]],
    })
);

/** A family whose muons are as rare at its end as those of 5 km of water. */
const deep = /** @type {Family} */ ({
    ...family,
    depth_max_m: 5000,
    rates: Array.from({ length: 65 }, (_, i) => {
        const depth = 0.7 * (5000.7 / 0.7) ** (i / 64) - 0.7;
        return [i === 64 ? 5000 : Math.abs(depth), rateAt(depth)];
    }),
});

/** @param {number} depth */
function rateAt(depth) {
    return 110 * (1 + depth / 5) ** -1.2 * Math.exp(-depth / 500);
}

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

test("a slider through kilometres is fine near the surface, and coarse below", () => {
    assert.deepEqual(
        [0, 0.1, 0.2, 0.4, 0.6, 0.8, 1].map((share) => depthAlong(deep, share)),
        [0, 1, 3.43, 23.7, 143, 847, 5000],
    );
    assert.deepEqual(marksAlong(deep), [0, 1, 10, 100, 1000, 5000]);
    assert.deepEqual(marksAlong(family), [0, 1, 10, 100]);
});

test("a key goes to the next round depth, and to the ends of the range", () => {
    /** @param {number} from @param {1 | -1} direction @param {boolean} isFar */
    const way = (from, direction, isFar) => {
        const depths = [from];
        while (depths.length < 100) {
            const next = depthBeside(deep, depths[depths.length - 1], direction, isFar);
            if (next === depths[depths.length - 1]) break;
            depths.push(next);
        }
        return depths;
    };
    assert.deepEqual(way(0, 1, true), [0, 0.1, 1, 10, 100, 1000, 5000]);
    assert.deepEqual(way(5000, -1, true), [5000, 1000, 100, 10, 1, 0.1, 0]);
    assert.deepEqual(way(1370, -1, false).slice(0, 4), [1370, 1200, 1000, 800]);
    assert.deepEqual(way(13.7, 1, false).slice(0, 4), [13.7, 15, 20, 25]);
    assert.equal(way(0, 1, false).length, 49);
    assert.equal(way(2.3, 1, false).at(-1), 5000);
});

test("where rates fall by nine powers of ten, that between known depths is right within one in a thousand", () => {
    for (let depth = 0; depth <= 5000; depth += 0.3 + depth / 20) {
        const { rate_hz_per_m2 } = familyAt(deep, depth);
        assert.ok(Math.abs(rate_hz_per_m2 / rateAt(depth) - 1) < 1e-3, `${depth}: ${rate_hz_per_m2}`);
    }
});

test("the muons by which a family was judged are those of the very depth", () => {
    assert.deepEqual(familyAt(family, 10).held_out, { by_energy: [1], by_cos_zenith: [2] });
    assert.equal(familyAt(family, 10.1).held_out, null);
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
