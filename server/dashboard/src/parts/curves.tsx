import { useEffect, useRef, useState } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';

import type { Sample } from '../api';
import { compact, count, number, ratio, superscript } from '../format';
import { stageName } from '../job_model';
import { phasesOf, type Phase } from '../phases';
import { colour, onThemeChange } from '../theme';

interface Line {
    label: string;
    ink: string;
    of: (sample: Sample) => number | null;
}

interface Plot {
    title: string;
    /** A sentence for who sees such a curve for the first time. */
    meaning: string;
    isLog: boolean;
    isQuality?: boolean;
    /** What to say before there is anything. */
    empty?: string;
    lines: Line[];
}

/** A logarithm has no zero. */
const positive = (value: number | undefined) => (value && value > 0 ? value : null);

const plots: Plot[] = [
    {
        title: 'Forces and steps',
        meaning: 'What still pulls at the particles, and how far they move in an iteration; in edge lengths h.',
        isLog: true,
        lines: [
            { label: 'residual force', ink: 'ink-1', of: (s) => positive(s.residual_force) },
            { label: 'largest step', ink: 'ink-2', of: (s) => positive(s.max_displacement) },
            { label: 'rms step', ink: 'ink-3', of: (s) => positive(s.rms_displacement) },
        ],
    },
    {
        title: 'Energy',
        meaning: 'Stored in the springs between particles, and in their motion; mean of a particle.',
        isLog: true,
        lines: [
            { label: 'potential', ink: 'ink-1', of: (s) => positive(s.potential_energy) },
            { label: 'kinetic', ink: 'ink-2', of: (s) => positive(s.kinetic_energy) },
        ],
    },
    {
        title: 'Particles',
        meaning: 'Points that become the vertices of the mesh; those inside come once the surface has relaxed.',
        isLog: false,
        lines: [
            { label: 'all', ink: 'ink-1', of: (s) => Number(s.particles ?? 0) || null },
            { label: 'on the surface', ink: 'ink-2', of: (s) => Number(s.surface_particles ?? 0) || null },
        ],
    },
    {
        title: 'Mesh quality',
        meaning: 'Radius ratio of the tetrahedra: 1 is regular, 0 is flat. Measured after each pass of the improvement.',
        isLog: false,
        isQuality: true,
        empty: 'Measured once the particles have become a mesh.',
        lines: [
            { label: 'mean', ink: 'ink-1', of: (s) => s.quality?.mean ?? null },
            { label: 'worst 1 %', ink: 'ink-2', of: (s) => s.quality?.first_percentile ?? null },
        ],
    },
];

const [residuals, energies, particles, quality] = plots as [Plot, Plot, Plot, Plot];

/** How the run converges: what one watches, beside the view. */
export function MainCurves(props: { samples: Sample[]; skipped: number }) {
    const { samples } = props;
    return (
        <section class="main-curves" aria-labelledby="curves-title">
            <div class="section-title">
                <h2 id="curves-title">Convergence</h2>
                <span class="muted">
                    {samples.length > 0 && `iteration ${count(samples.at(-1)!.iteration)}`}
                    {props.skipped > 0 && ` · ${count(props.skipped)} events left out on a slow connection`}
                </span>
            </div>
            <Curve plot={residuals} samples={samples} />
            <Curve plot={quality} samples={samples} />
        </section>
    );
}

/** The rest of it. */
export function MoreCurves(props: { samples: Sample[] }) {
    return (
        <section class="curves" aria-label="More of the convergence">
            <Curve plot={energies} samples={props.samples} />
            <Curve plot={particles} samples={props.samples} />
        </section>
    );
}

function Curve(props: { plot: Plot; samples: Sample[] }) {
    const { plot, samples } = props;
    const lines = plot.lines.map((line) => samples.map(line.of));
    const hasData = lines.some((line) => line.some((value) => value !== null));
    const last = lines.map((line) => line.findLast((entry) => entry !== null) ?? undefined);
    return (
        <figure class="card curve">
            <figcaption>
                <strong>{plot.title}</strong>
                <small class="meaning">{plot.meaning}</small>
                <ul class="legend" aria-label="Newest values">
                    {plot.lines.map((line, i) => (
                        <li key={line.label}>
                            <i class={line.ink} aria-hidden="true" />
                            {line.label} <b>{plot.isQuality ? ratio(last[i]) : number(last[i])}</b>
                        </li>
                    ))}
                </ul>
            </figcaption>
            {hasData ? (
                <Canvas plot={plot} x={samples.map((sample) => sample.iteration)} lines={lines} phases={phasesOf(samples)} />
            ) : (
                <p class="nothing plot-space">{plot.empty ?? 'Nothing yet.'}</p>
            )}
            <SampleTable plot={plot} samples={samples} />
        </figure>
    );
}

const height = 190;

function Canvas(props: { plot: Plot; x: number[]; lines: (number | null)[][]; phases: Phase[] }) {
    const place = useRef<HTMLDivElement>(null);
    const phases = useRef(props.phases);
    phases.current = props.phases;
    const chart = useRef<uPlot | null>(null);
    const [look, setLook] = useState(0);
    useEffect(() => onThemeChange(() => setLook((n) => n + 1)), []);
    useEffect(() => {
        const element = place.current!;
        chart.current = new uPlot(optionsOf(props.plot, element.clientWidth, () => phases.current), [[], ...props.lines.map(() => [])], element);
        const observer = new ResizeObserver(() => chart.current?.setSize({ width: element.clientWidth, height }));
        observer.observe(element);
        return () => {
            observer.disconnect();
            chart.current?.destroy();
            chart.current = null;
        };
    }, [props.plot, look]);
    useEffect(() => {
        // Quality has values at the very end only: its axis starts there.
        const from = props.plot.isQuality ? props.x.findIndex((_, i) => props.lines[0]![i] !== null) : 0;
        const data = [props.x, ...props.lines].map((column) => column.slice(from));
        chart.current?.setData(data as uPlot.AlignedData);
    }, [props.x, props.lines, look]);
    return <div ref={place} class="canvas" aria-hidden="true" />;
}

function optionsOf(plot: Plot, width: number, phases: () => Phase[]): uPlot.Options {
    const axis: uPlot.Axis = {
        stroke: colour('muted'),
        font: `11px ${getComputedStyle(document.body).fontFamily}`,
        grid: { stroke: colour('line'), width: 1 },
        ticks: { show: false },
    };
    const powers = (_u: uPlot, ticks: number[]) => ticks.map((tick) => (power(tick) ? tick : null));
    return {
        width,
        height,
        legend: { show: false },
        cursor: { points: { size: 6 }, y: false, drag: { x: true, y: false } },
        padding: [plot.isQuality ? 8 : 18, 12, 0, 0],
        hooks: plot.isQuality ? {} : { drawAxes: [(chart) => drawPhases(chart, phases())] },
        scales: {
            x: { time: false },
            y: plot.isLog ? { distr: 3 } : { range: (_u, low, high) => (plot.isQuality ? qualityRange(low) : [0, high * 1.1 || 1]) },
        },
        axes: [
            {
                ...axis,
                size: 22,
                gap: 4,
                label: 'iteration',
                labelSize: 14,
                labelGap: 0,
                labelFont: axis.font,
                values: (_u, ticks) => ticks.map((tick) => (Number.isInteger(tick) ? count(tick) : '')),
            },
            {
                ...axis,
                ...(plot.isLog ? { filter: powers, grid: { ...axis.grid, filter: powers } } : {}),
                size: 50,
                values: (_u, ticks) =>
                    ticks.map((tick) => (tick === null ? '' : plot.isLog ? power(tick) : plot.isQuality ? tick.toFixed(2) : compact(tick))),
            },
        ],
        series: [
            {},
            ...plot.lines.map(
                (line): uPlot.Series => ({
                    label: line.label,
                    stroke: colour(line.ink),
                    width: 1.75,
                    spanGaps: true,
                    // Few samples, of a run that was over in no time, are shown as such.
                    points: { show: (chart) => plot.isQuality || chart.data[0].length < 25, size: 5, fill: colour(line.ink) },
                }),
            ),
        ],
    };
}

/** From a round number below the worst to a regular element. */
function qualityRange(low: number): [number, number] {
    return [Math.max(0, Math.floor((low - 0.02) * 10) / 10), 1];
}

/** Where the surface was done and the volume began: without it a second peak looks like a fault. */
function drawPhases(chart: uPlot, phases: Phase[]) {
    const { ctx, bbox } = chart;
    const [low, high] = [chart.scales.x!.min, chart.scales.x!.max];
    if (low == null || high == null || phases.length < 2) {
        return;
    }
    ctx.save();
    ctx.font = `${10.5 * devicePixelRatio}px ${getComputedStyle(document.body).fontFamily}`;
    ctx.textAlign = 'left';
    ctx.textBaseline = 'alphabetic';
    ctx.fillStyle = colour('muted');
    ctx.strokeStyle = colour('strong-line');
    ctx.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const { name, from, to } of phases.filter((phase) => phase.to > low && phase.from < high)) {
        const left = Math.max(bbox.left, chart.valToPos(from, 'x', true));
        const right = Math.min(bbox.left + bbox.width, chart.valToPos(to, 'x', true));
        if (left > bbox.left + 1) {
            ctx.beginPath();
            ctx.moveTo(left, bbox.top);
            ctx.lineTo(left, bbox.top + bbox.height);
            ctx.stroke();
        }
        if (ctx.measureText(name).width < right - left) {
            ctx.fillText(name, left + 2, bbox.top - 6 * devicePixelRatio);
        }
    }
    ctx.restore();
}

function power(value: number): string {
    const exponent = Math.log10(value);
    const whole = Math.round(exponent);
    if (Math.abs(exponent - whole) > 1e-6) {
        return '';
    }
    return whole === 0 ? '1' : whole === 1 ? '10' : `10${superscript(whole)}`;
}

const longestTable = 100;

/** The same as numbers, thinned out evenly if there are many. */
function SampleTable(props: { plot: Plot; samples: Sample[] }) {
    const [isOpen, setOpen] = useState(false);
    const stride = Math.ceil(props.samples.length / longestTable);
    const rows = isOpen ? props.samples.filter((_, i) => i % stride === 0 || i === props.samples.length - 1) : [];
    return (
        <details class="as-table" onToggle={(event) => setOpen(event.currentTarget.open)}>
            <summary>
                As a table<span class="sr">: {props.plot.title}</span>
            </summary>
            <div class="scroll" tabIndex={0} role="group" aria-label={`Table: ${props.plot.title}`}>
                <table>
                    <thead>
                        <tr>
                            <th scope="col">Iteration</th>
                            <th scope="col">Stage</th>
                            {props.plot.lines.map((line) => (
                                <th key={line.label} scope="col" class="right">
                                    {line.label}
                                </th>
                            ))}
                        </tr>
                    </thead>
                    <tbody>
                        {rows.map((sample) => (
                            <tr key={sample.iteration}>
                                <td>{sample.iteration}</td>
                                <td>{stageName(sample.stage).toLowerCase()}</td>
                                {props.plot.lines.map((line) => (
                                    <td key={line.label} class="right">
                                        {number(line.of(sample) ?? undefined)}
                                    </td>
                                ))}
                            </tr>
                        ))}
                    </tbody>
                </table>
            </div>
        </details>
    );
}
