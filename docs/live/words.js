/** Numbers in words. */

const integer = new Intl.NumberFormat("en");
const three = new Intl.NumberFormat("en", { maximumSignificantDigits: 3 });

const DAY = 86400;
const YEAR = 365.25 * DAY;

/** Times in which muons are counted, the shortest first: the word, the unit of a rate, seconds. */
const PERIODS = [
    { name: "a second", unit: "s⁻¹", seconds: 1 },
    { name: "a minute", unit: "min⁻¹", seconds: 60 },
    { name: "an hour", unit: "h⁻¹", seconds: 3600 },
    { name: "a day", unit: "day⁻¹", seconds: DAY },
    { name: "a year", unit: "year⁻¹", seconds: YEAR },
];

/** @type {[string, number][]} the longest first */
const WAITS = [
    ["years", YEAR],
    ["months", YEAR / 12],
    ["weeks", 7 * DAY],
    ["days", DAY],
    ["hours", 3600],
    ["minutes", 60],
];

const SLOW = 0.1; // muons a second, of which fewer are told by how long one takes

/** @type {[string, number][]} */
const UNITS = [
    ["year", YEAR],
    ["day", DAY],
    ["h", 3600],
    ["min", 60],
    ["s", 1],
];

/** @param {number} number of things */
export function count(number) {
    return integer.format(number);
}

/** @param {number} number to three digits */
export function rounded(number) {
    return number >= 1e6 ? `${three.format(number / 1e6)} million` : three.format(number);
}

/**
 * A time in its two largest units: 2 h 30 min.
 *
 * @param {number} seconds
 */
export function duration(seconds) {
    if (seconds < 60) return `${three.format(seconds)} s`;
    const largest = UNITS.findIndex(([, size]) => seconds >= size);
    const [[, size], [, finer]] = UNITS.slice(largest, largest + 2);
    const whole = Math.floor((Math.round(seconds / finer) * finer) / size);
    if (whole >= 100) return `${rounded(whole)} ${UNITS[largest][0]}s`; // years
    const rest = Math.round((seconds - whole * size) / finer);
    return [units(whole, UNITS[largest]), rest > 0 && units(rest, UNITS[largest + 1])].filter(Boolean).join(" ");
}

/**
 * @param {number} number
 * @param {[string, number]} unit
 */
function units(number, [unit, size]) {
    return `${count(number)} ${unit}${number > 1 && size >= DAY ? "s" : ""}`;
}

/**
 * The shortest of the times in which one muon or more comes.
 *
 * @param {number} hz muons per second
 */
export function periodOf(hz) {
    return PERIODS.find(({ seconds }) => hz * seconds >= 1) ?? PERIODS[PERIODS.length - 1];
}

/**
 * How often muons come: "56 muons a second", "17.4 muons a year".
 *
 * @param {number} hz
 */
export function often(hz) {
    const { name, seconds } = periodOf(hz);
    const number = rounded(hz * seconds);
    return `${number} ${number === "1" ? "muon" : "muons"} ${name}`;
}

/**
 * How long one muon takes, where that is long: ", one in 3 weeks".
 *
 * @param {number} hz
 */
export function oneIn(hz) {
    if (hz >= SLOW) return "";
    const seconds = 1 / hz;
    const [name, size] = WAITS.find(([, size]) => seconds >= 1.5 * size) ?? ["seconds", 1];
    return `, one in ${rounded(Math.round(seconds / size))} ${name}`;
}

/**
 * The depth that a reader typed, in metres.
 *
 * @param {string} text
 * @param {number} least
 * @param {number} most
 * @throws {RangeError} in words, if it is none
 */
export function readDepth(text, least, most) {
    return readMetres(text, least, most, `How deep? From ${least} to ${most} m.`);
}

/**
 * A size of a target that a reader typed, in metres.
 *
 * @param {string} text
 * @throws {RangeError} in words, if it is none
 */
export function readSize(text) {
    return readMetres(text, 0.1, 10, "How large? From 0.1 to 10 m, such as 2.5; deepmuon-gen has no such bounds.");
}

/**
 * @param {string} text
 * @param {number} least
 * @param {number} most
 * @param {string} question to who typed something else
 */
function readMetres(text, least, most, question) {
    const digits = text.trim().replace(/\s*m$/, "");
    const metres = /^\d+(\.\d*)?$|^\.\d+$/.test(digits) ? Number(digits) : Number.NaN;
    if (!(metres >= least && metres <= most)) throw new RangeError(question);
    return metres;
}

/**
 * The number that a reader typed: 1000000, 1e6, 1M, 1,000,000 or 1_000_000. A comma is none of decimals: 1,5 is refused.
 *
 * @param {string} text
 * @param {number} largest
 * @throws {RangeError} in words, if it is no number of muons
 */
export function readNumber(text, largest) {
    const [, digits, letter] = /** @type {RegExpExecArray} */ (/^(.*?)\s*([kM]?)$/s.exec(text.trim()));
    const grouped = /^\d{1,3}([\s,_]\d{3})+$/.test(digits);
    const plain = /^\d+(\.\d+)?(e\+?\d+)?$/i.test(digits);
    const typed = grouped || plain ? Number(digits.replace(/[\s,_]/g, "")) : Number.NaN;
    const number = Number((typed * (letter === "M" ? 1e6 : letter === "k" ? 1e3 : 1)).toPrecision(15));
    if (!Number.isInteger(number) || number < 1) {
        throw new RangeError("How many muons? A whole number, such as 1000000, 1,000,000, 1e6 or 1M.");
    }
    if (number > largest) {
        throw new RangeError(`This page keeps ${count(largest)} muons at most; deepmuon-gen writes any number.`);
    }
    return number;
}
