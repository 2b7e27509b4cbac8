/** The form: which model, how many muons, which seed. */

import { newSeed, readSeed } from "./latents.js";
import { place } from "./models.js";
import { element } from "./page.js";
import { duration, readNumber } from "./words.js";

const LARGEST_NUMBER = 10_000_000; // 170 MB

const depth = element("depth", HTMLSelectElement);
const architecture = element("architecture", HTMLSelectElement);
const number = element("number", HTMLInputElement);
const seed = element("seed", HTMLInputElement);

/** @typedef {import("./models.js").Model} Model */

export class Choices {
    /**
     * @param {import("./models.js").Released} released
     * @param {() => void} modelChanged is called when another model was picked
     */
    constructor({ models, default_architecture }, modelChanged) {
        this.models = models;
        const depths = [...new Set(models.map(({ depth_m }) => depth_m))].sort((a, b) => a - b);
        depth.replaceChildren(...depths.map((metres) => new Option(nameOf(metres), String(metres))));
        this.offerArchitectures(default_architecture);
        depth.onchange = () => {
            this.offerArchitectures(architecture.value);
            this.check();
            modelChanged();
        };
        architecture.onchange = modelChanged;
        number.oninput = seed.oninput = () => this.check();
        this.check();
    }

    /** @param {string} wanted */
    offerArchitectures(wanted) {
        const there = this.models.filter(({ depth_m }) => String(depth_m) === depth.value);
        architecture.replaceChildren(...there.map((model) => new Option(model.architecture)));
        if (there.some((model) => model.architecture === wanted)) architecture.value = wanted;
    }

    /** @returns {Model} */
    get model() {
        const is = (/** @type {Model} */ model) =>
            String(model.depth_m) === depth.value && model.architecture === architecture.value;
        return /** @type {Model} */ (this.models.find(is));
    }

    /** The model at sea level of the same architecture, where another one is picked. */
    get surface() {
        const { model } = this;
        if (model.depth_m === 0) return undefined;
        return this.models.find((other) => other.depth_m === 0 && other.architecture === model.architecture);
    }

    /** Say beside the fields what they mean, or what is wrong. */
    check() {
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
        const wrong = [number, seed].find((field) => field.ariaInvalid === "true");
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
