/** What a moving picture goes by. */

const LONGEST_STEP = 0.25; // seconds; a longer one, as of a hidden tab, is not made up for

export class Clock {
    /** @param {(seconds: number) => void} advance is called at each frame, with the time since the last one */
    constructor(advance) {
        this.advance = advance;
        this.playing = false;
        this.frame = 0; // that is asked for
    }

    play() {
        if (this.playing) return;
        this.playing = true;
        let last = performance.now();
        /** @param {number} now */
        const tick = (now) => {
            this.frame = requestAnimationFrame(tick);
            this.advance(Math.max(0, Math.min(LONGEST_STEP, (now - last) / 1000)));
            last = now;
        };
        this.frame = requestAnimationFrame(tick);
    }

    pause() {
        this.playing = false;
        cancelAnimationFrame(this.frame);
    }
}
