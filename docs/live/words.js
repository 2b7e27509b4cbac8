/** Numbers in words. */

const integer = new Intl.NumberFormat("en");
const three = new Intl.NumberFormat("en", { maximumSignificantDigits: 3 });

const DAY = 86400;

/** @type {[string, number][]} */
const UNITS = [
    ["year", 365.25 * DAY],
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
 * The depth that a reader typed, in metres.
 *
 * @param {string} text
 * @param {number} least
 * @param {number} most
 * @throws {RangeError} in words, if it is none
 */
export function readDepth(text, least, most) {
    return readMetres(text, least, most, `How deep? From ${least} to ${most} m, such as 13.7.`);
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
