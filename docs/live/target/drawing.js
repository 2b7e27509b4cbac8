/**
 * A body and its muons, at the moments when they come and the places where they enter. A muon's way shines up and ends
 * there; a point stays for a while.
 */

import { Clock } from "../clock.js";
import { colourOf } from "../energy_colours.js";
import { count, duration, oneIn } from "../words.js";
import { NUMBERS_OF_HIT } from "./aim.js";
import { ENLARGED, isSeen, outlineOf, projected } from "./isometric.js";

const FLASH = 1.2; // seconds for which a muon shines
const SHINING = 200; // muons at once, at most: of more, each shines for less
const POINTS = 3000; // that stay
const STILL = 30; // ways in a drawing without motion
const FINEST = 2; // device pixels to a CSS pixel, at most
const WAY = 1.1; // that is seen of a muon's, in reaches of the body
const MARGIN = 1.6; // around the body, for the ways

/** @typedef {{way: [number, number], place: [number, number], colour: string, isSeen: boolean, time: number}} Arrival */
/** @typedef {ReturnType<typeof import("./bodies.js").bodyOf>} Body */

export class Drawing {
    /** @param {HTMLCanvasElement} canvas */
    constructor(canvas) {
        this.canvas = canvas;
        this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
        this.clock = new Clock((seconds) => this.advance(seconds));
        /** @type {Body | undefined} */
        this.body = undefined;
        /** @type {Float32Array} */
        this.hits = new Float32Array();
        this.rate = 0;
        this.pace = 1; // seconds of theirs in one of the reader's
        this.seconds = 0; // of the reader's
        this.elapsed = 0; // of the muons'
        this.next = 0; // when the next muon arrives
        this.arrived = 0;
        /** @type {Arrival[]} the last ones */
        this.arrivals = [];
        new ResizeObserver(() => this.resize()).observe(canvas);
    }

    /**
     * Begin anew.
     *
     * @param {Body} body
     * @param {number} rate muons per second
     * @param {Float32Array} hits that come one after the other; after the last the first come again
     */
    show(body, rate, hits) {
        this.body = body;
        this.rate = rate;
        this.hits = hits;
        this.rewind();
    }

    /**
     * Let time go faster, or as it does.
     *
     * @param {number} pace seconds of the muons in one of the reader's
     */
    hurry(pace) {
        this.pace = pace;
        this.next = this.seconds + this.wait();
    }

    play() {
        if (this.clock.playing) return;
        this.clock.play();
        this.rewind();
    }

    /** Stop, and show many muons at once. */
    pause() {
        this.clock.pause();
        this.rewind();
    }

    rewind() {
        this.seconds = this.elapsed = 0;
        this.arrived = 0;
        this.arrivals = [];
        this.next = this.wait();
        if (!this.clock.playing) this.arrive(Math.min(POINTS, this.hits.length / NUMBERS_OF_HIT));
        this.paint();
    }

    /** @param {number} seconds */
    advance(seconds) {
        this.seconds += seconds;
        this.elapsed += seconds * this.pace;
        let number = 0;
        while (this.next < this.seconds) {
            this.next += this.wait();
            number += 1;
        }
        this.arrive(number);
        this.paint();
    }

    /** How long it is to the next muon: they are independent, a Poisson process. */
    wait() {
        return -Math.log(1 - Math.random()) / (this.rate * this.pace);
    }

    /** @param {number} number of muons that come now */
    arrive(number) {
        const { body, hits } = this;
        if (!body) return;
        for (let i = Math.max(0, number - POINTS); i < number; i++) {
            const at = ((this.arrived + i) * NUMBERS_OF_HIT) % hits.length;
            const [energy, u, v, w, x, y, z] = hits.subarray(at, at + NUMBERS_OF_HIT);
            const length = WAY * body.reach;
            this.arrivals.push({
                way: projected([x - length * u, y - length * v, z - length * w]),
                place: projected([x, y, z]),
                colour: colourOf(energy),
                isSeen: isSeen(body, [x, y, z]),
                time: this.seconds,
            });
        }
        this.arrived += number;
        this.arrivals.splice(0, this.arrivals.length - POINTS);
    }

    resize() {
        const size = Math.round(this.canvas.clientWidth * Math.min(FINEST, devicePixelRatio));
        if (size === this.canvas.width || size === 0) return;
        this.canvas.width = this.canvas.height = size;
        this.paint();
    }

    paint() {
        const { context, canvas, body } = this;
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.globalAlpha = 1;
        context.fillStyle = "#0b1533";
        context.fillRect(0, 0, canvas.width, canvas.height);
        if (!body) return;
        const pixel = canvas.width / Math.max(1, canvas.clientWidth);
        const scale = canvas.width / (2 * MARGIN * ENLARGED * body.reach);
        context.translate(canvas.width / 2, canvas.height / 2);
        const { seen, hidden } = outlineOf(body);
        this.paintLines(hidden, scale, pixel, "#ffffff50", [4 * pixel, 4 * pixel]);
        this.paintPoints(scale, pixel);
        this.paintLines(seen, scale, pixel, "#ffffffc0", []);
        this.paintWays(scale, pixel);
        if (this.clock.playing) this.paintCount(pixel);
    }

    /**
     * @param {import("./bodies.js").Place[][]} lines
     * @param {number} scale pixels of the canvas to a metre
     * @param {number} pixel a pixel of the style sheet, in those of the canvas
     * @param {string} colour
     * @param {number[]} dashes
     */
    paintLines(lines, scale, pixel, colour, dashes) {
        const { context } = this;
        context.globalAlpha = 1;
        context.strokeStyle = colour;
        context.lineWidth = 1.2 * pixel;
        context.setLineDash(dashes);
        context.beginPath();
        for (const line of lines) {
            for (const [i, corner] of line.entries()) {
                const [right, down] = projected(corner);
                if (i === 0) context.moveTo(right * scale, down * scale);
                else context.lineTo(right * scale, down * scale);
            }
        }
        context.stroke();
        context.setLineDash([]);
    }

    /**
     * @param {number} scale
     * @param {number} pixel
     */
    paintPoints(scale, pixel) {
        const { context } = this;
        for (const { place, colour, isSeen } of this.arrivals) {
            context.globalAlpha = isSeen ? 0.7 : 0.25;
            context.fillStyle = colour;
            context.fillRect(
                place[0] * scale - 0.75 * pixel,
                place[1] * scale - 0.75 * pixel,
                1.5 * pixel,
                1.5 * pixel,
            );
        }
    }

    /**
     * @param {number} scale
     * @param {number} pixel
     */
    paintWays(scale, pixel) {
        const { context } = this;
        const flash = Math.min(FLASH, SHINING / (this.rate * this.pace));
        for (const { way, place, colour, isSeen, time } of this.arrivals.slice(
            this.clock.playing ? -SHINING : -STILL,
        )) {
            const left = this.clock.playing ? 1 - (this.seconds - time) / flash : 0.7;
            if (left <= 0) continue;
            context.globalAlpha = left ** 2 * (isSeen ? 1 : 0.6);
            context.strokeStyle = context.fillStyle = colour;
            context.lineWidth = 1.4 * pixel;
            context.beginPath();
            context.moveTo(way[0] * scale, way[1] * scale);
            context.lineTo(place[0] * scale, place[1] * scale);
            context.stroke();
            context.beginPath();
            context.arc(place[0] * scale, place[1] * scale, 2.5 * pixel, 0, 2 * Math.PI);
            context.fill();
        }
    }

    /** @param {number} pixel */
    paintCount(pixel) {
        const { context, canvas } = this;
        context.globalAlpha = 1;
        context.fillStyle = "#ffffffd0";
        context.font = `${13 * pixel}px sans-serif`;
        const time = this.elapsed < 60 ? `${this.elapsed.toFixed(1)} s` : duration(this.elapsed);
        const rarity = this.pace === 1 ? oneIn(this.rate) : "";
        const text = `${count(this.arrived)} muons in ${time}${rarity}`;
        context.fillText(text, 12 * pixel - canvas.width / 2, canvas.height / 2 - 12 * pixel);
    }
}
