// The parts of a run that a curve goes through.

import type { Sample } from './api';

export interface Phase {
    name: string;
    from: number; // iteration, as the end of the one before
    to: number;
}

function phaseOf(sample: Sample): string {
    if (sample.stage !== 'STAGE_RELAX') {
        return 'mesh';
    }
    return Number(sample.particles ?? 0) > Number(sample.surface_particles ?? 0) ? 'volume' : 'surface';
}

/** First the particles of the surface relax, then those inside, then the mesh is improved. */
export function phasesOf(samples: Sample[]): Phase[] {
    const phases: Phase[] = [];
    for (const sample of samples) {
        const name = phaseOf(sample);
        const last = phases.at(-1);
        if (last?.name === name) {
            last.to = sample.iteration;
        } else {
            const from = last ? (last.to + sample.iteration) / 2 : sample.iteration;
            if (last) {
                last.to = from;
            }
            phases.push({ name, from, to: sample.iteration });
        }
    }
    return phases;
}
