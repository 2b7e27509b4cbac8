import assert from "node:assert/strict";
import { test } from "node:test";
import { count, duration, often, oneIn, periodOf, readNumber, rounded } from "../../docs/live/words.js";

test("a time is told in its two largest units", () => {
    assert.equal(duration(0.009), "0.009 s");
    assert.equal(duration(12.34), "12.3 s");
    assert.equal(duration(60), "1 min");
    assert.equal(duration(9022), "2 h 30 min");
    assert.equal(duration(3600 * 24), "1 day");
    assert.equal(duration(3600 * 50), "2 days 2 h");
    assert.equal(duration(86400 * 400), "1 year 35 days");
    assert.equal(duration(86400 * 365.25 * 99.9), "99 years 329 days");
    assert.equal(duration(86400 * 365.25 * 250_000), "250,000 years");
});

test("a rate is told in the time in which one muon or more comes", () => {
    for (const [hz, text] of /** @type {[number, string][]} */ ([
        [1234.5, "1,230 muons a second"],
        [1, "1 muon a second"],
        [0.5, "30 muons a minute"],
        [0.01, "36 muons an hour"],
        [1e-4, "8.64 muons a day"],
        [1e-6, "31.6 muons a year"],
        [1e-9, "0.0316 muons a year"],
    ])) {
        assert.equal(often(hz), text);
    }
    assert.equal(periodOf(0.02).unit, "min⁻¹");
});

test("of rare muons it is said how long one takes", () => {
    assert.equal(oneIn(0.1), "");
    for (const [seconds, text] of /** @type {[number, string][]} */ ([
        [12.3, ", one in 12 seconds"],
        [89, ", one in 89 seconds"],
        [600, ", one in 10 minutes"],
        [86400, ", one in 24 hours"],
        [86400 * 21, ", one in 3 weeks"],
        [86400 * 60, ", one in 2 months"],
        [86400 * 365 * 50, ", one in 50 years"],
    ])) {
        assert.equal(oneIn(1 / seconds), text);
    }
});

test("large numbers can be read", () => {
    assert.equal(count(1234567), "1,234,567");
    assert.equal(rounded(98765.4), "98,800");
    assert.equal(rounded(1234567), "1.23 million");
});

test("a number of muons may be written in the ways of deepmuon-gen", () => {
    for (const text of ["1000000", "1e6", "1,000,000", "1_000_000", " 1 000 000 ", "1M", "1.0 M", "1000k", "0.001e9"]) {
        assert.equal(readNumber(text, 1e7), 1e6, text);
    }
});

test("what is no number of muons is refused in words", () => {
    for (const text of [
        "",
        "many",
        "0",
        "-5",
        "1.5",
        "1e400",
        "NaN",
        "1,5",
        "1,5M",
        "10,00,000",
        "10m",
        "0x10",
        "1e-3",
        "M",
    ]) {
        assert.throws(() => readNumber(text, 1e7), /How many muons/, text);
    }
    assert.throws(() => readNumber("1e8", 1e7), /10,000,000 muons at most/);
});
