/** What is seen of the muons: figures, charts, the sky, and the command that makes the same. */

import { place } from "./models.js";
import { element } from "./page.js";
import { Sky } from "./sky.js";
import { Spectra } from "./spectra.js";
import { count, duration, rounded } from "./words.js";

/** @typedef {import("./models.js").Model} Model */
/** @typedef {import("./tally.js").Tally} Tally */

const motion = element("motion", HTMLButtonElement);
const command = element("command", HTMLElement);
const again = element("again", HTMLElement);

export class Results {
    constructor() {
        this.spectra = new Spectra(element("energy", HTMLElement), element("zenith", HTMLElement));
        this.sky = new Sky(element("sky", HTMLCanvasElement));
        const stillness = matchMedia("(prefers-reduced-motion: reduce)");
        stillness.onchange = () => this.move(!stillness.matches);
        motion.onclick = () => this.move(!this.sky.clock.playing);
        this.move(!stillness.matches);
    }

    /** @param {boolean} moving whether the sky is */
    move(moving) {
        if (moving) this.sky.play();
        else this.sky.pause();
        motion.textContent = moving ? "Pause the sky" : "Play the sky";
    }

    /**
     * Before there are muons.
     *
     * @param {Model} model
     * @param {Model | undefined} surface the same at sea level
     */
    begin(model, surface) {
        for (const id of ["made", "speed", "wait", "mean", "ratio", "unphysical"]) write(id, "–");
        element("surface-key", HTMLElement).hidden = !surface?.held_out;
        element("held-out-key", HTMLElement).hidden = !model.held_out;
        again.hidden = true;
        this.spectra.draw(model, surface, undefined);
        this.sky.reset(model.rate_hz_per_m2);
        write("sky-note", `${rounded(model.rate_hz_per_m2)} muons a second ${place(model.depth_m)}`);
    }

    /**
     * @param {import("./run.js").Progress} progress
     * @param {Model} model
     * @param {Model | undefined} surface
     * @param {number} seconds it took
     */
    show({ tally, arrivals }, model, surface, seconds) {
        write("made", count(tally.count));
        write("speed", rounded(tally.count / seconds));
        write("wait", duration(tally.count / model.rate_hz_per_m2));
        write("mean", `${(tally.energySum / tally.count).toFixed(2)} GeV`);
        write("ratio", (tally.positive / (tally.count - tally.unphysical - tally.positive)).toFixed(3));
        write("unphysical", count(tally.unphysical));
        this.spectra.draw(model, surface, tally);
        this.sky.add(arrivals);
    }

    /**
     * @param {Model} model
     * @param {number} number
     * @param {bigint} seed
     */
    showCommand({ depth_m, architecture }, number, seed) {
        command.textContent = `deepmuon-gen --depth ${depth_m} --architecture ${architecture} -n ${number} --seed ${seed} -o muons.h5`;
        again.hidden = false;
    }
}

/**
 * @param {string} id
 * @param {string} text
 */
function write(id, text) {
    element(id, HTMLElement).textContent = text;
}
