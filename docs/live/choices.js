/** The form: which model at which depth, how many muons, which seed. */

import { newSeed, readSeed } from "./latents.js";
import { familyAt, isFamily, place } from "./models.js";
import { element } from "./page.js";
import { Slider } from "./slider.js";
import { duration, often, oneIn, readDepth, readNumber } from "./words.js";

const LARGEST_NUMBER = 10_000_000; // 170 MB
const ANY = "any"; // depth, of a family

const depth = element("depth", HTMLSelectElement);
const metres = element("metres", HTMLInputElement);
const number = element("number", HTMLInputElement);
const seed = element("seed", HTMLInputElement);

/** @typedef {import("./models.js").Model} Model */

/**
 * What a model is chosen by, one after the other: each offers what there is of those before it.
 *
 * @type {[HTMLSelectElement, (model: Model) => string, (value: string) => string][]}
 */
const CHOICES = [
    [element("flux", HTMLSelectElement), ({ flux }) => flux, (flux) => NAMES_OF_FLUXES[flux] ?? flux],
    [element("medium", HTMLSelectElement), ({ medium }) => medium, (medium) => medium],
    [element("architecture", HTMLSelectElement), ({ architecture }) => architecture, (architecture) => architecture],
    [depth, optionOf, nameOf],
];

/** @type {Record<string, string>} */
const NAMES_OF_FLUXES = { cry: "CRY’s" };

export class Choices {
    /**
     * @param {import("./models.js").Released} released
     * @param {() => void} modelChanged is called when another model was picked
     * @param {() => void} depthChanged is called when another depth of a family was
     */
    constructor({ models, default: named }, modelChanged, depthChanged) {
        this.models = models;
        const first = models.find(({ name }) => name === named) ?? models[0];
        this.metres = first.depth_m;
        this.slider = new Slider(() => {
            this.check();
            depthChanged();
        });
        this.offer(first);
        metres.oninput = () => {
            this.check();
            if (metres.ariaInvalid === "false") depthChanged();
        };
        for (const [select] of CHOICES) {
            select.onchange = () => {
                if (select === depth && depth.value !== ANY) this.metres = Number(depth.value);
                this.offer();
                this.check();
                modelChanged();
            };
        }
        number.oninput = seed.oninput = () => this.check();
        this.check();
    }

    /**
     * Offer what there is of each choice, and keep what was chosen as far as it is there.
     *
     * @param {Model} [first] to be chosen
     */
    offer(first) {
        let there = this.models;
        for (const [select, valueOf, nameOf] of CHOICES) {
            const values = [...new Set(there.map(valueOf))];
            const wanted = first ? valueOf(first) : select === depth ? this.nearest(values) : select.value;
            select.replaceChildren(...values.map((value) => new Option(nameOf(value), value)));
            if (values.includes(wanted)) select.value = wanted;
            there = there.filter((model) => valueOf(model) === select.value);
        }
        const field = /** @type {HTMLElement} */ (depth.closest(".field"));
        field.hidden = depth.options.length === 1 && depth.value === ANY;
        const [model] = there;
        this.metres = isFamily(model)
            ? Math.min(model.depth_max_m, Math.max(model.depth_min_m, this.metres))
            : model.depth_m;
        metres.value = String(this.metres);
    }

    /**
     * Which of some depths is the nearest to the last one.
     *
     * @param {string[]} values
     */
    nearest(values) {
        if (values.includes(ANY)) return ANY;
        const far = (/** @type {string} */ value) => Math.abs(Number(value) - this.metres);
        return values.reduce((one, other) => (far(other) < far(one) ? other : one));
    }

    /** @returns {Model} */
    get model() {
        const found = /** @type {Model} */ (
            this.models.find((model) => CHOICES.every(([select, valueOf]) => valueOf(model) === select.value))
        );
        return isFamily(found) ? familyAt(found, this.metres) : found;
    }

    /** The family that is picked, if one is. */
    get family() {
        const { model } = this;
        return isFamily(model) ? model : undefined;
    }

    /** The model at sea level of the same flux and architecture, where another one is picked. */
    get surface() {
        const { model } = this;
        if (model.depth_m === 0) return undefined;
        if (isFamily(model)) return model.depth_min_m === 0 ? familyAt(model, 0) : undefined;
        const isSame = CHOICES.filter(([select]) => select !== depth).map(([, valueOf]) => valueOf);
        return this.models.find(
            (other) => other.depth_m === 0 && isSame.every((valueOf) => valueOf(other) === valueOf(model)),
        );
    }

    /** Say beside the fields what they mean, or what is wrong. */
    check() {
        const { family } = this;
        element("any-depth", HTMLElement).hidden = !family;
        note(metres, () => {
            if (!family) return "";
            this.metres = readDepth(metres.value, family.depth_min_m, family.depth_max_m);
            const here = familyAt(family, this.metres);
            this.slider.show(here);
            return `${often(here.rate_hz_per_m2)} cross a horizontal m²${oneIn(here.rate_hz_per_m2)}.`;
        });
        note(number, () => {
            const { model } = this;
            const seconds = readNumber(number.value, LARGEST_NUMBER) / model.rate_hz_per_m2;
            return `A horizontal detector of 1 m² ${place(model)} waits ${duration(seconds)} for so many.`;
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

/** @param {string} option */
function nameOf(option) {
    return option === ANY ? "any depth" : option === "0" ? "sea level" : `${option} m`;
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
