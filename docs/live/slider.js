/** The slider through a family's depths, fine near the surface and coarse below, and the keys that step beside it. */

import { depthAlong, depthBeside, marksAlong, shareOfRange } from "./models.js";
import { element } from "./page.js";
import { often } from "./words.js";

const metres = element("metres", HTMLInputElement);
const label = element("metres-label", HTMLElement);
const slider = element("slider", HTMLInputElement);
const scale = element("slider-scale", HTMLElement);

const LENGTH = Number(slider.max);

/** @type {Record<string, [1 | -1, boolean]>} which way a key steps, and whether far */
const KEYS = {
    ArrowDown: [-1, false],
    ArrowUp: [1, false],
    PageDown: [-1, true],
    PageUp: [1, true],
};

/** @type {typeof KEYS} */
const KEYS_OF_SLIDER = { ...KEYS, ArrowLeft: [-1, false], ArrowRight: [1, false] };

/** @typedef {import("./models.js").Family} Family */

export class Slider {
    /** @param {() => void} moved is called when the field has another depth */
    constructor(moved) {
        this.moved = moved;
        /** @type {Family | undefined} */
        this.family = undefined;
        this.marked = "";
        slider.oninput = () => {
            if (this.family) this.move(depthAlong(this.family, Number(slider.value) / LENGTH));
        };
        slider.onkeydown = (event) => this.step(event, KEYS_OF_SLIDER);
        metres.onkeydown = (event) => this.step(event, KEYS);
    }

    /**
     * @param {KeyboardEvent} event
     * @param {typeof KEYS} keys
     */
    step(event, keys) {
        if (!this.family || !(event.key in keys)) return;
        event.preventDefault();
        this.move(depthBeside(this.family, this.family.depth_m, ...keys[event.key]));
    }

    /** @param {number} depth */
    move(depth) {
        metres.value = String(depth);
        this.moved();
    }

    /** @param {Family} family at its depth */
    show(family) {
        this.family = family;
        const { depth_m, depth_max_m, medium, rate_hz_per_m2 } = family;
        label.textContent = `Metres of ${medium}`;
        slider.ariaLabel = `Slide through the ${medium}`;
        slider.value = String(shareOfRange(family, depth_m) * LENGTH);
        slider.ariaValueText = `${depth_m} m of ${medium}, ${often(rate_hz_per_m2)} and square metre`;
        const marks = marksAlong(family);
        if (marks.join() === this.marked) return;
        this.marked = marks.join();
        scale.replaceChildren(
            ...marks.map((depth) => {
                const mark = document.createElement("span");
                mark.textContent = depth === depth_max_m ? `${depth} m` : String(depth);
                mark.style.left = `${100 * shareOfRange(family, depth)}%`;
                return mark;
            }),
        );
    }
}
