/** What is seen of the muons: figures, charts, the sky, and the command that makes the same. */

import { optionsOf, place } from "./models.js";
import { Pace } from "./pace.js";
import { element } from "./page.js";
import { Sky } from "./sky.js";
import { isSeenBeside, Spectra } from "./spectra.js";
import { count, duration, often, oneIn, rounded } from "./words.js";

/** @typedef {import("./models.js").Model} Model */
/** @typedef {import("./tally.js").Tally} Tally */

const motion = element("motion", HTMLButtonElement);
const command = element("command", HTMLElement);
const again = element("again", HTMLElement);

export class Results {
    constructor() {
        this.spectra = new Spectra(element("energy", HTMLElement), element("zenith", HTMLElement));
        this.sky = new Sky(element("sky", HTMLCanvasElement));
        this.rate = 0; // muons per second and m²
        this.pace = new Pace(element("pace", HTMLSelectElement), () => this.sky.hurry(this.rate * this.pace.factor));
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
        element("surface-key", HTMLElement).hidden = !isSeenBeside(model, surface);
        element("held-out-key", HTMLElement).hidden = !model.held_out;
        again.hidden = true;
        this.spectra.draw(model, surface, undefined);
        this.rate = model.rate_hz_per_m2;
        this.pace.offer(this.rate);
        this.sky.reset(this.rate * this.pace.factor);
        write("sky-note", `${often(this.rate)} ${place(model)}${oneIn(this.rate)}`);
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
    showCommand(model, number, seed) {
        command.textContent = `deepmuon-gen ${optionsOf(model)} -n ${number} --seed ${seed} -o muons.h5`;
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
