/** A histogram in SVG, drawn anew whenever the numbers or the width change. Its colours are live.css's. */

/**
 * @typedef {object} Axis
 * @property {string} title
 * @property {(value: number) => number} place from 0, where the axis begins, to 1
 * @property {{value: number, label: string}[]} ticks
 *
 * @typedef {object} Steps a histogram's density, constant in each bin
 * @property {string} name its class in live.css
 * @property {number[]} edges
 * @property {number[]} values
 *
 * @typedef {object} Points a density and its standard error at the middle of each bin
 * @property {number[]} edges
 * @property {number[]} values
 * @property {number[]} errors
 *
 * @typedef {object} Content
 * @property {string} description for who does not see it
 * @property {Axis} x
 * @property {Axis} y
 * @property {Steps[]} steps
 * @property {Points} [points]
 */

const HEIGHT = 300;
const MARGIN = { top: 12, right: 20, bottom: 46, left: 58 };

/**
 * An axis of powers of ten.
 *
 * @param {string} title
 * @param {number} from exponent
 * @param {number} to exponent
 * @returns {Axis}
 */
export function logAxis(title, from, to) {
    const ticks = [];
    for (let power = from; power <= to; power++) ticks.push({ value: 10 ** power, label: powerOfTen(power) });
    return { title, ticks, place: (value) => (Math.log10(value) - from) / (to - from) };
}

/**
 * An axis from 0 on.
 *
 * @param {string} title
 * @param {number} to
 * @param {number} step of the ticks
 * @returns {Axis}
 */
export function linearAxis(title, to, step) {
    const ticks = [];
    for (let i = 0; i * step <= to * 1.0001; i++) {
        ticks.push({ value: i * step, label: String(Number((i * step).toPrecision(6))) });
    }
    return { title, ticks, place: (value) => value / to };
}

/**
 * A linear axis that ends at a round number.
 *
 * @param {string} title
 * @param {number} largest value it has to show
 */
export function roundAxis(title, largest) {
    const step = 10 ** Math.floor(Math.log10(largest / 3));
    const rounder = [1, 2, 5, 10].map((factor) => factor * step).find((size) => largest / size <= 6) ?? 10 * step;
    return linearAxis(title, Math.ceil(largest / rounder) * rounder, rounder);
}

export class Chart {
    /** @param {HTMLElement} container */
    constructor(container) {
        this.container = container;
        /** @type {Content | undefined} */
        this.content = undefined;
        new ResizeObserver(() => this.redraw()).observe(container);
    }

    /** @param {Content} content */
    draw(content) {
        this.content = content;
        this.container.ariaLabel = content.description;
        this.redraw();
    }

    redraw() {
        const width = this.container.clientWidth;
        if (!this.content || width === 0) return;
        const { x, y, steps, points } = this.content;
        const frame = {
            left: MARGIN.left,
            right: width - MARGIN.right,
            top: MARGIN.top,
            bottom: HEIGHT - MARGIN.bottom,
        };
        /** @param {number} value */
        const atX = (value) => frame.left + x.place(value) * (frame.right - frame.left);
        /** @param {number} value */
        const atY = (value) => frame.bottom - clamp(y.place(value)) * (frame.bottom - frame.top);
        this.container.innerHTML = `
            <svg width="${width}" height="${HEIGHT}" aria-hidden="true">
                ${drawX(x, atX, frame)}
                ${drawY(y, atY, frame)}
                ${steps.map((curve) => drawSteps(curve, atX, atY)).join("")}
                ${points ? drawPoints(points, atX, atY) : ""}
            </svg>`;
    }
}

/** @typedef {(value: number) => number} Place */
/** @typedef {{left: number, right: number, top: number, bottom: number}} Frame */

/**
 * @param {Axis} axis
 * @param {Place} at
 * @param {Frame} frame
 */
function drawX({ title, ticks }, at, { left, right, top, bottom }) {
    const lines = ticks.map(
        ({ value, label }) => `
            <line class="grid" x1="${at(value)}" x2="${at(value)}" y1="${top}" y2="${bottom}" />
            <text class="tick" x="${at(value)}" y="${bottom + 17}" text-anchor="middle">${label}</text>`,
    );
    return `${lines.join("")}<text x="${(left + right) / 2}" y="${bottom + 39}" text-anchor="middle">${title}</text>`;
}

/**
 * @param {Axis} axis
 * @param {Place} at
 * @param {Frame} frame
 */
function drawY({ title, ticks }, at, { left, right, top, bottom }) {
    const lines = ticks.map(
        ({ value, label }) => `
            <line class="grid" x1="${left}" x2="${right}" y1="${at(value)}" y2="${at(value)}" />
            <text class="tick" x="${left - 7}" y="${at(value)}" dy="0.35em" text-anchor="end">${label}</text>`,
    );
    const middle = (top + bottom) / 2;
    return `${lines.join("")}
        <text x="14" y="${middle}" text-anchor="middle" transform="rotate(-90 14 ${middle})">${title}</text>`;
}

/**
 * @param {Steps} steps
 * @param {Place} atX
 * @param {Place} atY
 */
function drawSteps({ name, edges, values }, atX, atY) {
    const corners = values.flatMap((value, i) => [
        `${atX(edges[i]).toFixed(1)},${atY(value).toFixed(1)}`,
        `${atX(edges[i + 1]).toFixed(1)},${atY(value).toFixed(1)}`,
    ]);
    const [first, last] = [edges[0], edges[values.length]].map((edge) => atX(edge).toFixed(1));
    const floor = atY(0).toFixed(1);
    return `
        <polygon class="${name} area" points="${first},${floor} ${corners.join(" ")} ${last},${floor}" />
        <polyline class="${name} line" points="${corners.join(" ")}" />`;
}

/**
 * @param {Points} points
 * @param {Place} atX
 * @param {Place} atY
 */
function drawPoints({ edges, values, errors }, atX, atY) {
    const marks = values.map((value, i) => {
        if (value === 0) return "";
        const x = ((atX(edges[i]) + atX(edges[i + 1])) / 2).toFixed(1);
        return `
            <line x1="${x}" x2="${x}" y1="${atY(value - errors[i])}" y2="${atY(value + errors[i])}" />
            <circle cx="${x}" cy="${atY(value)}" r="1.8" />`;
    });
    return `<g class="points">${marks.join("")}</g>`;
}

/** @param {number} share a logarithm of 0 included */
function clamp(share) {
    return Math.max(0, Math.min(1, share));
}

/** @param {number} power */
function powerOfTen(power) {
    if (power >= -2 && power <= 3) return String(10 ** power);
    const digits = [...String(power)].map((digit) => (digit === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)]));
    return `10${digits.join("")}`;
}
