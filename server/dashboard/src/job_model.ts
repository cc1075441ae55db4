// What a page knows of one job: its events, folded together.

import { terminalStates, type Digest, type Job, type JobEvent, type Sample, type Warning } from './api';

export const stages = [
    'READ',
    'PREPARE',
    'FEATURES',
    'SIZING',
    'SEED',
    'RELAX',
    'TETRAHEDRALIZE',
    'CARVE',
    'IMPROVE',
    'VERIFY',
    'REPORT',
    'WRITE',
] as const;

export function stageName(stage: string | undefined): string {
    return (stage ?? '').replace(/^STAGE_/, '');
}

export interface StageTime {
    start: number;
    seconds: number;
    visits: number;
}

export interface Preview {
    digest: Digest;
    iteration: number;
}

export class JobModel {
    job: Job | null = null;
    samples: Sample[] = [];
    warnings: Warning[] = [];
    preview: Preview | null = null;
    skipped = 0;
    /** Whether the last event was seen: nothing more will come. */
    isComplete = false;
    stageTimes = new Map<string, StageTime>();
    private openStage = '';
    private seen = 0;

    /** \return whether something changed */
    apply(event: JobEvent): boolean {
        const sequence = Number(event.sequence ?? 0);
        if (sequence > 0) {
            if (sequence <= this.seen) {
                return false;
            }
            this.seen = sequence;
        }
        this.skipped += Number(event.skipped_events ?? 0);
        const time = Date.parse(event.time);
        if (event.snapshot) {
            this.take(event.snapshot, sequence, time);
        } else if (event.completed) {
            this.leaveStage(time);
            this.job = event.completed;
            this.isComplete = true;
        } else if (event.progress) {
            this.advance(stageName(event.progress.stage), time);
            if (this.job && !terminalStates.has(this.job.state)) {
                this.job = { ...this.job, progress: event.progress };
            }
        } else if (event.sample) {
            this.addSample(event.sample);
        } else if (event.warning) {
            this.warnings.push(event.warning);
        } else if (event.preview) {
            this.preview = { digest: event.preview.digest, iteration: event.preview.iteration ?? 0 };
        }
        return true;
    }

    private take(job: Job, sequence: number, time: number) {
        if (sequence > 0) {
            this.leaveStage(time);
            if (job.state === 'STATE_RUNNING') {
                // A new attempt starts from the beginning, or where the last one stood.
                this.stageTimes.clear();
                this.warnings = [];
                this.preview = null;
            }
        }
        // What opens a stream is the newest; history that follows it must not undo it.
        if (!this.job || !terminalStates.has(this.job.state) || sequence === 0) {
            this.job = job;
        }
    }

    private addSample(sample: Sample) {
        // A new attempt begins anew, or goes on a little before where the last one was lost.
        const kept = this.samples.findIndex((known) => known.iteration >= sample.iteration);
        if (kept >= 0) {
            this.samples = this.samples.slice(0, kept);
        }
        this.samples.push(sample);
    }

    private advance(stage: string, time: number) {
        if (stage === this.openStage) {
            return;
        }
        this.leaveStage(time);
        this.openStage = stage;
        const known = this.stageTimes.get(stage);
        this.stageTimes.set(stage, {
            start: time,
            seconds: known?.seconds ?? 0,
            visits: (known?.visits ?? 0) + 1,
        });
    }

    private leaveStage(time: number) {
        const open = this.stageTimes.get(this.openStage);
        if (open) {
            open.seconds += Math.max(0, (time - open.start) / 1000);
        }
        this.openStage = '';
    }
}
