/** The form: which model, how many muons, which seed. */

import { newSeed, readSeed } from "./latents.js";
import { depthAlong, familyAt, isFamily, place, shareOfRange } from "./models.js";
import { element } from "./page.js";
import { duration, readDepth, readNumber } from "./words.js";

const LARGEST_NUMBER = 10_000_000; // 170 MB
const ANY = "any"; // depth, of a family

const depth = element("depth", HTMLSelectElement);
const architecture = element("architecture", HTMLSelectElement);
const metres = element("metres", HTMLInputElement);
const slider = element("slider", HTMLInputElement);
const number = element("number", HTMLInputElement);
const seed = element("seed", HTMLInputElement);

/** @typedef {import("./models.js").Model} Model */

export class Choices {
    /**
     * @param {import("./models.js").Released} released
     * @param {() => void} modelChanged is called when another model was picked
     * @param {() => void} depthChanged is called when another depth of a family was
     */
    constructor({ models, default_architecture }, modelChanged, depthChanged) {
        this.models = models;
        const families = models.filter(isFamily);
        const fixed = models.filter((model) => !isFamily(model)).map(({ depth_m }) => depth_m);
        const depths = [...new Set(fixed)].sort((a, b) => a - b);
        depth.replaceChildren(
            ...families.slice(0, 1).map(() => new Option("any depth", ANY)),
            ...depths.map((metres) => new Option(nameOf(metres), String(metres))),
        );
        this.metres = families[0]?.depth_m ?? 0;
        metres.value = String(this.metres);
        this.offerArchitectures(default_architecture);
        slider.oninput = () => {
            const { family } = this;
            if (!family) return;
            metres.value = String(depthAlong(family, Number(slider.value) / Number(slider.max)));
            this.check();
            depthChanged();
        };
        metres.oninput = () => {
            this.check();
            if (metres.ariaInvalid === "false") depthChanged();
        };
        depth.onchange = () => {
            this.offerArchitectures(architecture.value);
            this.check();
            modelChanged();
        };
        architecture.onchange = () => {
            this.check();
            modelChanged();
        };
        number.oninput = seed.oninput = () => this.check();
        this.check();
    }

    /** @param {string} wanted */
    offerArchitectures(wanted) {
        const there = this.models.filter((model) => optionOf(model) === depth.value);
        architecture.replaceChildren(...there.map((model) => new Option(model.architecture)));
        if (there.some((model) => model.architecture === wanted)) architecture.value = wanted;
    }

    /** @returns {Model} */
    get model() {
        const is = (/** @type {Model} */ model) =>
            optionOf(model) === depth.value && model.architecture === architecture.value;
        const found = /** @type {Model} */ (this.models.find(is));
        return isFamily(found) ? familyAt(found, this.metres) : found;
    }

    /** The family that is picked, if one is. */
    get family() {
        const { model } = this;
        return isFamily(model) ? model : undefined;
    }

    /** The model at sea level of the same architecture, where another one is picked. */
    get surface() {
        const { model } = this;
        if (model.depth_m === 0) return undefined;
        return this.models.find((other) => optionOf(other) === "0" && other.architecture === model.architecture);
    }

    /** Say beside the fields what they mean, or what is wrong. */
    check() {
        const { family } = this;
        for (const field of document.querySelectorAll(".any-depth")) {
            if (field instanceof HTMLElement) field.hidden = !family;
        }
        note(metres, () => {
            if (!family) return "";
            this.metres = readDepth(metres.value, family.depth_min_m, family.depth_max_m);
            slider.value = String(shareOfRange(family, this.metres) * Number(slider.max));
            slider.ariaValueText = `${this.metres} m`;
            return "";
        });
        note(number, () => {
            const seconds = readNumber(number.value, LARGEST_NUMBER) / this.model.rate_hz_per_m2;
            return `A horizontal detector of 1 m² ${place(this.model.depth_m)} waits ${duration(seconds)} for so many.`;
        });
        note(seed, () => {
            this.seed();
            return "";
        });
    }

    /**
     * What is asked for.
     *
     * @returns {{model: Model, number: number, seed: bigint} | undefined} nothing if a field has to be mended, which then has the focus
     */
    read() {
        this.check();
        const wrong = [metres, number, seed].find((field) => field.ariaInvalid === "true");
        if (wrong) {
            wrong.focus();
            return undefined;
        }
        return { model: this.model, number: readNumber(number.value, LARGEST_NUMBER), seed: this.seed() };
    }

    seed() {
        return seed.value.trim() === "" ? newSeed() : readSeed(seed.value);
    }
}

/**
 * What a model is called among the depths.
 *
 * @param {Model} model
 */
function optionOf(model) {
    return isFamily(model) ? ANY : String(model.depth_m);
}

/** @param {number} metres */
function nameOf(metres) {
    return metres === 0 ? "sea level" : `${metres} m of water`;
}

/**
 * @param {HTMLInputElement} field
 * @param {() => string} text throws a RangeError if the field is wrong
 */
function note(field, text) {
    const line = element(`${field.id}-note`, HTMLElement);
    try {
        line.textContent = text();
        field.ariaInvalid = "false";
    } catch (error) {
        if (!(error instanceof RangeError)) throw error;
        line.textContent = error.message;
        field.ariaInvalid = "true";
    }
    line.classList.toggle("wrong", field.ariaInvalid === "true");
}
