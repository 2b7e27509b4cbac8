/** The live page: makes the muons that the reader chooses, shows them and saves them. */

import { Choices } from "./choices.js";
import { Engine } from "./engine.js";
import { fetchReleased, place } from "./models.js";
import { workOffline } from "./offline.js";
import { element } from "./page.js";
import { Results } from "./results.js";
import { TargetView } from "./target/view.js";
import { count, duration, rounded } from "./words.js";

/** @typedef {import("./models.js").Model} Model */

const form = element("form", HTMLFormElement);
const fields = element("choices", HTMLFieldSetElement);
const generateButton = element("generate", HTMLButtonElement);
const stopButton = element("stop", HTMLButtonElement);
const saveButton = element("save", HTMLButtonElement);
const bar = element("progress", HTMLProgressElement);
const status = element("status", HTMLElement);
const problem = element("error", HTMLElement);

const PREVIEW = 1 << 15; // muons of a spectrum that moves with the slider
const PREVIEW_SEED = 1n;
const BETWEEN_PICTURES = 50; // ms: drawing each block would take longer than making it

class App {
    /** @param {import("./models.js").Released} released */
    constructor(released) {
        this.results = new Results();
        this.target = new TargetView();
        this.choices = new Choices(
            released,
            () => {
                this.pick();
                if (this.choices.family) this.follow();
            },
            () => this.follow(),
        );
        this.engine = new Engine();
        this.stopped = false;
        this.picks = 0;
        this.isBehind = false; // the spectrum, of the slider
        /** @type {Promise<void> | undefined} */
        this.following = undefined;
        this.blocks = 0; // that the worker keeps
        this.fileName = "";
        form.onsubmit = (event) => {
            event.preventDefault();
            this.generate();
        };
        stopButton.onclick = () => {
            this.stopped = true;
        };
        saveButton.onclick = () => this.save();
        generateButton.disabled = false;
        this.pick();
        status.textContent = "Ready.";
    }

    /** Another model is picked, and there are no muons of it yet. */
    pick() {
        this.picks += 1;
        this.blocks = 0;
        saveButton.disabled = true;
        status.textContent = "";
        this.results.begin(this.choices.model, this.choices.surface);
        this.target.follow(this.choices.family);
    }

    /** The slider moves, and with it the spectrum and what hits the target. */
    follow() {
        this.blocks = 0;
        saveButton.disabled = true;
        this.target.follow(this.choices.family);
        this.isBehind = true;
        this.following ??= this.catchUp().finally(() => {
            this.following = undefined;
        });
    }

    /** Show few muons of the depth where the slider is, until it rests. */
    async catchUp() {
        try {
            while (this.isBehind) {
                this.isBehind = false;
                const { picks } = this;
                const { model, surface } = this.choices;
                await this.engine.ask("open", model);
                await this.engine.ask("start", PREVIEW, PREVIEW_SEED);
                const begun = performance.now();
                let progress = await this.engine.ask("more");
                while (progress.tally.count < PREVIEW) progress = await this.engine.ask("more");
                if (picks !== this.picks) continue; // another model was picked
                this.results.begin(model, surface);
                this.results.show(progress, model, surface, (performance.now() - begun) / 1000);
                status.textContent = `The spectrum ${place(model)}, of ${count(PREVIEW)} muons.`;
            }
        } catch (error) {
            this.fail(error);
        }
    }

    generate() {
        const wanted = this.choices.read();
        if (!wanted) return;
        const { model, number, seed } = wanted;
        const { surface } = this.choices;
        this.pick();
        this.work(async () => {
            this.isBehind = false;
            await this.following;
            status.textContent = `Getting the ${model.architecture} model ready …`;
            await this.engine.ask("open", model);
            await this.engine.ask("start", number, seed);
            status.textContent = `Making ${count(number)} muons ${place(model)} …`;
            const begun = performance.now();
            let [made, seconds, drawn] = [0, 0, 0];
            let coming = this.engine.ask("more");
            while (made < number && !this.stopped) {
                const progress = await coming;
                const now = performance.now();
                made = progress.tally.count;
                seconds = (now - begun) / 1000;
                this.blocks = progress.blocks;
                const isLast = made >= number || this.stopped;
                if (!isLast) coming = this.engine.ask("more"); // while this draws
                if (!isLast && now - drawn < BETWEEN_PICTURES) continue;
                bar.value = made / number;
                this.results.show(progress, model, surface, seconds);
                drawn = now;
            }
            this.fileName = `muons-${nameOf(model)}-seed-${seed}.csv`;
            this.results.showCommand(model, made, seed);
            const wait = duration(made / model.rate_hz_per_m2);
            status.textContent =
                `${this.stopped ? "Stopped: " : ""}${count(made)} muons in ${duration(seconds)}, ` +
                `${rounded(made / seconds)} a second. A detector of 1 m² waits ${wait} for them.`;
        });
    }

    save() {
        this.work(async () => {
            status.textContent = "Writing the file …";
            const parts = [];
            while (parts.length < this.blocks && !this.stopped) {
                parts.push(await this.engine.ask("csv", parts.length));
                bar.value = parts.length / this.blocks;
            }
            if (this.stopped) {
                status.textContent = "Stopped: no file was saved.";
                return;
            }
            download(new Blob(parts, { type: "text/csv" }), this.fileName);
            status.textContent = `Saved as ${this.fileName}.`;
        });
    }

    /**
     * Do something that takes a while, which the reader may stop, and say so if it fails.
     *
     * @param {() => Promise<void>} task
     */
    async work(task) {
        this.stopped = false;
        problem.textContent = "";
        bar.value = 0;
        this.setBusy(true);
        try {
            await task();
        } catch (error) {
            this.fail(error);
        }
        this.setBusy(false);
    }

    /** @param {boolean} busy */
    setBusy(busy) {
        const hadFocus = form.contains(document.activeElement);
        fields.disabled = generateButton.disabled = busy;
        saveButton.disabled = busy || this.blocks === 0;
        stopButton.disabled = bar.hidden = !busy;
        if (hadFocus) (busy ? stopButton : generateButton).focus();
    }

    /** @param {unknown} error */
    fail(error) {
        status.textContent = "";
        problem.textContent = error instanceof Error ? error.message : String(error);
        this.blocks = 0;
        this.engine.close(); // what failed may be broken
        this.engine = new Engine();
    }
}

/** @param {Model} model */
function nameOf({ flux, medium, architecture, depth_m }) {
    return `${flux}-${medium}-${architecture}-${depth_m}m`;
}

/**
 * @param {Blob} file
 * @param {string} name
 */
function download(file, name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(file);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000); // the browser may ask first where to put it
}

try {
    new App(await fetchReleased());
    workOffline(element("offline", HTMLElement));
} catch (error) {
    status.textContent = "";
    problem.textContent = error instanceof Error ? error.message : String(error);
}
