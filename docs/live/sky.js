/**
 * The sky above a horizontal square metre: its muons, at the moments and from the directions in which they come. The
 * middle is the zenith, the edge the horizon. A muon shines up, and stays as a faint point, as on a long exposure.
 */

import { Clock } from "./clock.js";
import { colourOf, decadesOf } from "./energy_colours.js";

const FLASH = 1.5; // seconds for which a muon shines
const STILL = 3000; // muons of a sky without motion
const KEPT = 100_000; // muons; after the last the first come again
const FINEST = 2; // device pixels to a CSS pixel, at most
const POINT = 1.5; // CSS pixels that a point of the exposure is wide
const RINGS = [30, 60, 90]; // degrees from the zenith

/** @typedef {{x: number, y: number, radius: number, colour: string, time: number}} Arrival where, as a share of the radius of the sky */

export class Sky {
    /** @param {HTMLCanvasElement} canvas */
    constructor(canvas) {
        this.canvas = canvas;
        this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
        this.exposure = new OffscreenCanvas(1, 1);
        this.film = /** @type {OffscreenCanvasRenderingContext2D} */ (this.exposure.getContext("2d"));
        this.muons = new Float32Array(3 * KEPT); // energy, u and v of each
        this.half = 0; // radius of the sky, in pixels of the canvas
        this.pixel = 1; // a pixel of the style sheet, in those
        this.known = 0;
        this.rate = 0;
        this.clock = new Clock((seconds) => this.advance(seconds));
        this.seconds = 0;
        this.next = 0; // when the next muon arrives
        this.arrived = 0;
        /** @type {Arrival[]} */
        this.shining = [];
        new ResizeObserver(() => this.resize()).observe(canvas);
    }

    /**
     * Begin anew.
     *
     * @param {number} rate muons per second
     */
    reset(rate) {
        this.rate = rate;
        this.known = 0;
        this.rewind();
    }

    /**
     * Let muons come at another rate from now on.
     *
     * @param {number} rate muons per second
     */
    hurry(rate) {
        this.rate = rate;
        this.next = this.seconds + this.wait();
    }

    /** How long it is to the next muon: they are independent, a Poisson process. */
    wait() {
        return -Math.log(1 - Math.random()) / this.rate;
    }

    /** @param {Float32Array} arrivals energy, u and v of each muon */
    add(arrivals) {
        const added = arrivals.subarray(0, this.muons.length - 3 * this.known);
        this.muons.set(added, 3 * this.known);
        this.known += added.length / 3;
        if (!this.clock.playing) this.rest();
    }

    play() {
        if (this.clock.playing) return;
        this.rewind();
        this.clock.play();
    }

    /** Stop, and show many muons at once. */
    pause() {
        this.clock.pause();
        this.rewind();
        this.rest();
    }

    rewind() {
        this.seconds = 0;
        this.next = this.wait();
        this.arrived = 0;
        this.shining = [];
        this.film.clearRect(0, 0, this.exposure.width, this.exposure.height);
        this.paint();
    }

    rest() {
        while (this.arrived < Math.min(STILL, this.known)) this.expose(this.arrive(), 0.9);
        this.paint();
    }

    /** @param {number} seconds */
    advance(seconds) {
        if (this.known > 0) this.seconds += seconds;
        while (this.next < this.seconds) {
            const arrival = this.arrive();
            this.expose(arrival, 0.6);
            this.shining.push(arrival);
            this.next += this.wait();
        }
        this.shining = this.shining.filter(({ time }) => this.seconds - time < FLASH);
        this.paint();
    }

    /** @returns {Arrival} of the next muon */
    arrive() {
        const i = 3 * (this.arrived++ % this.known);
        const [energy, u, v] = this.muons.subarray(i, i + 3);
        const horizontal = Math.hypot(u, v);
        const share = Math.asin(Math.min(1, horizontal)) / (Math.PI / 2) / Math.max(horizontal, 1e-9);
        return {
            x: -u * share, // it comes from where it does not go
            y: v * share,
            radius: 1.6 + 0.6 * decadesOf(energy),
            colour: colourOf(energy),
            time: this.seconds,
        };
    }

    resize() {
        const size = Math.round(this.canvas.clientWidth * Math.min(FINEST, devicePixelRatio));
        if (size === this.canvas.width || size === 0) return;
        this.half = size / 2;
        this.pixel = size / this.canvas.clientWidth;
        this.canvas.width = this.canvas.height = size;
        this.exposure.width = this.exposure.height = size;
        this.rewind();
        if (!this.clock.playing) this.rest();
    }

    /**
     * Leave a point on the film.
     *
     * @param {Arrival} arrival
     * @param {number} opacity
     */
    expose({ x, y, colour }, opacity) {
        const { half, pixel } = this;
        this.film.globalAlpha = opacity;
        this.film.fillStyle = colour;
        this.film.fillRect(half + x * half * RIM, half + y * half * RIM, POINT * pixel, POINT * pixel);
    }

    paint() {
        const { half } = this;
        this.context.globalAlpha = 1;
        this.context.clearRect(0, 0, 2 * half, 2 * half);
        this.paintDome();
        this.context.drawImage(this.exposure, 0, 0);
        for (const arrival of this.shining) this.paintFlash(arrival);
    }

    paintDome() {
        const { context } = this;
        const { half, pixel } = this;
        const dome = context.createRadialGradient(half, half, 0, half, half, half * RIM);
        dome.addColorStop(0, "#0b1533");
        dome.addColorStop(1, "#1c2b57");
        context.fillStyle = dome;
        circle(context, half, half, half * RIM);
        context.fill();
        context.strokeStyle = "#ffffff33";
        context.fillStyle = "#ffffffb0";
        context.lineWidth = pixel;
        context.font = `${11 * pixel}px sans-serif`;
        for (const degrees of RINGS) {
            const radius = (half * RIM * degrees) / 90;
            circle(context, half, half, radius);
            context.stroke();
            context.fillText(`${degrees}°`, half + 4 * pixel, half - radius + 13 * pixel);
        }
    }

    /** @param {Arrival} arrival */
    paintFlash({ x, y, radius, colour, time }) {
        const { context } = this;
        const { half, pixel } = this;
        const age = (this.seconds - time) / FLASH;
        const [centreX, centreY] = [half + x * half * RIM, half + y * half * RIM];
        context.fillStyle = context.strokeStyle = colour;
        context.globalAlpha = (1 - age) ** 2;
        circle(context, centreX, centreY, radius * pixel);
        context.fill();
        context.globalAlpha = 0.5 * Math.max(0, 1 - 3 * age);
        circle(context, centreX, centreY, (radius + 30 * age) * pixel);
        context.stroke();
    }
}

const RIM = 0.995; // of the canvas, so that the horizon's line is inside

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} x
 * @param {number} y
 * @param {number} radius
 */
function circle(context, x, y, radius) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
}
