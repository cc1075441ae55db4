import type { Link } from '../follow';
import { word } from '../format';

/** The state of a job, told by shape and word as well as by colour. */
export function State(props: { state: string }) {
    const name = word(props.state);
    return (
        <span class={`state state-${name}`}>
            <i aria-hidden="true" />
            {name}
        </span>
    );
}

const linkWords: Record<Link, string> = {
    connecting: 'Connecting…',
    live: 'Live',
    lost: 'Connection lost, trying again…',
    over: '',
};

export function LinkState(props: { link: Link }) {
    return (
        <span class={`link link-${props.link}`} role="status">
            {linkWords[props.link]}
        </span>
    );
}

export function Bar(props: { fraction: number; label: string }) {
    const value = Math.round(100 * Math.min(1, Math.max(0, props.fraction)));
    return (
        <div class="bar" role="progressbar" aria-label={props.label} aria-valuenow={value} aria-valuemin={0} aria-valuemax={100}>
            <div style={{ transform: `scaleX(${value / 100})` }} />
        </div>
    );
}
