/** A target of the reader's choice, with its muons in real time: of a family alone, which has them from all sides. */

import { Engine } from "../engine.js";
import { newSeed } from "../latents.js";
import { optionsOf, place } from "../models.js";
import { Pace } from "../pace.js";
import { element } from "../page.js";
import { often, oneIn, periodOf, readSize, rounded } from "../words.js";
import { bodyOf, KINDS } from "./bodies.js";
import { Drawing } from "./drawing.js";

const section = element("target-section", HTMLElement);
const figure = element("target-figure", HTMLElement);
const choice = element("target", HTMLSelectElement);
const fields = [1, 2, 3].map((number) => element(`size-${number}`, HTMLInputElement));
const note = element("target-note", HTMLElement);
const noteOfEnds = element("target-ends", HTMLElement);
const motion = element("target-motion", HTMLButtonElement);
const canvas = element("target-drawing", HTMLCanvasElement);
const again = element("target-again", HTMLElement);
const command = element("target-command", HTMLElement);
const duration = element("target-time", HTMLElement);

const NOTHING = "null";

/** @typedef {import("../models.js").Family} Family */
/** @typedef {import("./aim.js").End} End */
/** @typedef {import("./bodies.js").Kind} Kind */
/** @typedef {{family: Family, kind: Kind, sizes: number[]}} Wanted */

export class TargetView {
    constructor() {
        this.drawing = new Drawing(canvas);
        this.pace = new Pace(element("target-pace", HTMLSelectElement), () => this.drawing.hurry(this.pace.factor));
        /** @type {Engine | undefined} its own, so that a run does not wait for it */
        this.engine = undefined;
        /** @type {Family | undefined} */
        this.family = undefined;
        this.wanted = NOTHING; // what is shown, or will be, as JSON
        this.isBehind = false;
        /** @type {Promise<void> | undefined} */
        this.following = undefined;
        const stillness = matchMedia("(prefers-reduced-motion: reduce)");
        this.isMoving = !stillness.matches;
        stillness.onchange = () => this.move(!stillness.matches);
        motion.onclick = () => this.move(!this.isMoving);
        choice.onchange = () => {
            this.offerSizes();
            this.update();
        };
        for (const field of fields) field.oninput = () => this.update();
        this.offerSizes();
        this.move(this.isMoving);
    }

    /** @param {Family | undefined} family that is picked, at its depth */
    follow(family) {
        this.family = family?.has_sphere ? family : undefined;
        this.update();
    }

    /** @param {boolean} moving */
    move(moving) {
        this.isMoving = moving;
        motion.textContent = moving ? "Pause the muons" : "Play the muons";
        if (moving && this.family && choice.value !== "") this.drawing.play();
        else this.drawing.pause();
    }

    /** Name the sizes that the body has. */
    offerSizes() {
        const names = choice.value === "" ? [] : KINDS[/** @type {Kind} */ (choice.value)].sizes;
        for (const [i, field] of fields.entries()) {
            const line = /** @type {HTMLElement} */ (field.closest(".field"));
            line.hidden = i >= names.length;
            const label = /** @type {HTMLElement} */ (line.querySelector("label"));
            label.textContent = `${names[i] ?? "Size"} / m`;
        }
    }

    /** Something else is chosen. */
    update() {
        section.hidden = !this.family;
        figure.hidden = choice.value === "";
        this.move(this.isMoving);
        try {
            const wanted = JSON.stringify(this.read() ?? null);
            if (wanted === this.wanted && wanted !== NOTHING) return;
            this.wanted = wanted;
            say("");
        } catch (error) {
            if (!(error instanceof RangeError)) throw error;
            this.wanted = NOTHING;
            say(error.message, true);
        }
        again.hidden = true;
        this.isBehind = this.wanted !== NOTHING;
        if (!this.isBehind) return;
        this.following ??= this.catchUp().finally(() => {
            this.following = undefined;
        });
    }

    /**
     * What is asked for.
     *
     * @returns {Wanted | undefined}
     * @throws {RangeError} in words, if a size has to be mended
     */
    read() {
        const { family } = this;
        if (!family || choice.value === "") return undefined;
        const kind = /** @type {Kind} */ (choice.value);
        const used = fields.slice(0, KINDS[kind].sizes.length);
        for (const field of used) field.ariaInvalid = String(!isSize(field.value));
        return { family, kind, sizes: used.map((field) => readSize(field.value)) };
    }

    /** Show what is wanted, until nothing else is. */
    async catchUp() {
        try {
            while (this.isBehind) {
                this.isBehind = false;
                const { wanted } = this;
                /** @type {Wanted} */
                const { family, kind, sizes } = JSON.parse(wanted);
                if (!this.engine) say("Getting the muons ready …");
                this.engine ??= new Engine();
                const found = await this.engine.ask("aim", family, kind, sizes, newSeed());
                if (this.wanted === wanted) this.show({ family, kind, sizes }, found);
            }
        } catch (error) {
            this.wanted = NOTHING;
            figure.hidden = true;
            this.drawing.pause();
            this.engine?.close(); // what failed may be broken
            this.engine = undefined;
            say(error instanceof Error ? error.message : String(error), true);
        }
    }

    /**
     * @param {Wanted} wanted
     * @param {Awaited<ReturnType<import("../worker.js").Answers["aim"]>>} found
     */
    show({ family, kind, sizes }, { hz, hits, ends }) {
        this.pace.offer(hz);
        this.drawing.hurry(this.pace.factor);
        this.drawing.show(bodyOf(kind, sizes), hz, hits);
        canvas.ariaLabel = `A ${kind} of ${sizes.join(" × ")} m, with points where muons enter it`;
        say(`${often(hz)} enter it ${place(family)}${oneIn(hz)}.`);
        if (ends) noteOfEnds.textContent = warningOf(kind, family, ends);
        const { seconds, name } = periodOf(hz);
        const time = Math.max(60, seconds);
        duration.textContent = time === 60 ? "a minute" : name;
        command.textContent = `deepmuon-gen ${optionsOf(family)} --${kind} ${sizes.join(" ")} --live-time ${time} -o muons.h5`;
        again.hidden = false;
    }
}

/**
 * That the muons at the top of a body are others than at its foot.
 *
 * @param {Kind} kind
 * @param {Family} family
 * @param {[End, End]} ends
 */
function warningOf(kind, { depth_m }, ends) {
    const { name, seconds } = periodOf(ends[1].flux);
    const [top, foot] = ends.map((end) => ({
        depth: Number(end.depth_m.toPrecision(6)),
        flux: rounded(end.flux * seconds),
    }));
    return (
        `The ${kind} gets the muons of its centre, at ${depth_m} m, all over: ${top.flux} ${name} and m² come to ` +
        `its top, at ${top.depth} m, and ${foot.flux} to its foot, at ${foot.depth} m.`
    );
}

/** @param {string} text */
function isSize(text) {
    try {
        readSize(text);
        return true;
    } catch {
        return false;
    }
}

/**
 * @param {string} text
 * @param {boolean} [isWrong]
 */
function say(text, isWrong = false) {
    note.textContent = text;
    noteOfEnds.textContent = "";
    note.classList.toggle("wrong", isWrong);
}
