import { terminalStates, type Job } from '../api';
import { duration } from '../format';
import { stageName, stages, type JobModel } from '../job_model';

/** The steps of a run, each as it passes. */
export function StageRail(props: { model: JobModel; job: Job; now: number }) {
    const { model, job } = props;
    const isOver = terminalStates.has(job.state);
    const current = isOver ? '' : stageName(job.progress?.stage);
    const failed = job.failure ? stageName(job.failure.stage) : '';
    const reached = stages.findIndex((stage) => stage === (current || failed));
    return (
        <ol class="stages" aria-label="Stages">
            {stages.map((stage, index) => {
                const time = model.stageTimes.get(stage);
                const isDone = job.state === 'STATE_SUCCEEDED' || (reached >= 0 ? index < reached : Boolean(time));
                const state =
                    stage === failed ? 'failed' : stage === current ? 'current' : isDone && time ? 'done' : isDone ? 'passed' : 'ahead';
                const seconds = time ? time.seconds + (stage === current ? (props.now - time.start) / 1000 : 0) : NaN;
                return (
                    <li key={stage} class={`stage-${state}`} aria-current={stage === current ? 'step' : undefined}>
                        <i aria-hidden="true" />
                        <span>{stage.toLowerCase()}</span>
                        <small>{Number.isFinite(seconds) && state !== 'ahead' ? duration(Math.max(0, seconds)) : ''}</small>
                    </li>
                );
            })}
        </ol>
    );
}
