import type { Histogram, Quality, Summary } from '../api';
import { count, number, percent, ratio } from '../format';

interface Panel {
    title: string;
    meaning: string;
    elements: string;
    /** Marks of the axis. */
    ticks: number[];
    value: (value: number | undefined) => string;
    before?: Summary;
    after?: Summary;
    afterLabel: string;
}

const ratioTicks = [0, 0.2, 0.4, 0.6, 0.8, 1];
const angle = (value: number | undefined) => (value === undefined ? '–' : `${number(value)}°`);

/** Distributions before and after, side by side, on one scale. */
export function Histograms(props: { quality: Quality }) {
    const { quality } = props;
    const panels: Panel[] = [
        {
            title: 'Triangles: radius ratio',
            meaning: 'Inscribed over circumscribed circle: 1 is equilateral, 0 degenerate.',
            elements: 'triangles',
            ticks: ratioTicks,
            value: ratio,
            before: quality.before?.radius_ratio,
            after: quality.after?.radius_ratio,
            afterLabel: 'after',
        },
        {
            title: 'Triangles: smallest angle',
            meaning: 'Of each triangle, in degrees: 60 is the best there is.',
            elements: 'triangles',
            ticks: [0, 15, 30, 45, 60],
            value: angle,
            before: quality.before?.min_angle,
            after: quality.after?.min_angle,
            afterLabel: 'after',
        },
    ];
    if (quality.tets) {
        panels.push(
            {
                title: 'Tetrahedra: radius ratio',
                meaning: 'Inscribed over circumscribed sphere: 1 is regular, 0 flat.',
                elements: 'tetrahedra',
                ticks: ratioTicks,
                value: ratio,
                after: quality.tets.radius_ratio,
                afterLabel: 'after',
            },
            {
                title: 'Tetrahedra: dihedral angles',
                meaning: 'Smallest and largest angle between faces of each, in degrees: 70.5 in a regular one.',
                elements: 'angles',
                ticks: [0, 30, 60, 90, 120, 150, 180],
                value: angle,
                after: quality.tets.dihedral,
                afterLabel: 'after',
            },
        );
    }
    return (
        <section aria-labelledby="histograms-title">
            <div class="section-title">
                <h2 id="histograms-title">Quality before and after</h2>
                <span class="muted">bars are shares of all elements, the dotted line is their mean</span>
            </div>
            <div class="histograms">
                {panels.map((panel) => (
                    <HistogramPanel key={panel.title} panel={panel} />
                ))}
            </div>
        </section>
    );
}

function HistogramPanel(props: { panel: Panel }) {
    const { panel } = props;
    const top = Math.max(highest(panel.before?.histogram), highest(panel.after?.histogram));
    return (
        <figure class="card">
            <figcaption>
                <strong>{panel.title}</strong>
                <small class="meaning">{panel.meaning}</small>
            </figcaption>
            <div class="pair">
                {panel.before && <Bars label="before" ink="ink-before" summary={panel.before} panel={panel} top={top} />}
                {panel.after && <Bars label={panel.afterLabel} ink="ink-1" summary={panel.after} panel={panel} top={top} />}
            </div>
            <HistogramTable panel={panel} />
        </figure>
    );
}

const half = 260;
const height = 120;
const space = { left: 30, top: 6, bottom: 20 };

function Bars(props: { label: string; ink: string; summary: Summary; panel: Panel; top: number }) {
    const { summary, panel } = props;
    const width = panel.before ? half : 2 * half;
    const shares = sharesOf(summary.histogram);
    const low = summary.histogram?.low ?? 0;
    const high = summary.histogram?.high ?? 1;
    const top = props.top || 1;
    const x = (value: number) => space.left + ((width - space.left) * (value - low)) / (high - low || 1);
    const y = (share: number) => space.top + height * (1 - share / top);
    const step = (width - space.left) / Math.max(1, shares.length);
    const ticks = panel.before && panel.ticks.length > 6 ? panel.ticks.filter((_, i) => i % 2 === 0) : panel.ticks;
    const levels = levelsBelow(top);
    return (
        <div>
            <svg
                class="bars"
                viewBox={`0 0 ${width} ${space.top + height + space.bottom}`}
                role="img"
                aria-label={`${props.label}: mean ${panel.value(summary.mean)}, worst ${panel.value(summary.min ?? 0)}, ${count(summary.count)} ${panel.elements}`}
            >
                {levels.map((share) => (
                    <g key={share}>
                        <line class="level" x1={space.left} x2={width} y1={y(share)} y2={y(share)} />
                        <text x={space.left - 5} y={y(share) + 3} text-anchor="end">
                            {Math.round(100 * share)} %
                        </text>
                    </g>
                ))}
                {shares.map((share, i) => (
                    <rect
                        key={i}
                        class={props.ink}
                        x={space.left + i * step + 0.75}
                        y={y(share)}
                        width={step - 1.5}
                        height={space.top + height - y(share)}
                        rx="1"
                    />
                ))}
                <line class="axis" x1={space.left} x2={width} y1={y(0) + 0.5} y2={y(0) + 0.5} />
                <line class="mean" x1={x(summary.mean ?? 0)} x2={x(summary.mean ?? 0)} y1={space.top} y2={y(0)} />
                {ticks.map((tick) => (
                    <text key={tick} x={x(tick)} y={y(0) + 14} text-anchor={tick === low ? 'start' : tick === high ? 'end' : 'middle'}>
                        {tick}
                    </text>
                ))}
            </svg>
            <p class="bars-label">
                <strong>{props.label}</strong> mean {panel.value(summary.mean)} · worst {panel.value(summary.min ?? 0)} ·{' '}
                {count(summary.count)} {panel.elements}
            </p>
        </div>
    );
}

/** One or two round shares below the highest bar. */
function levelsBelow(top: number): number[] {
    const step = [0.02, 0.05, 0.1, 0.2, 0.4].find((size) => top / size < 3.2) ?? 0.4;
    return Array.from({ length: Math.floor(top / step) }, (_, i) => (i + 1) * step);
}

function HistogramTable(props: { panel: Panel }) {
    const { before, after } = props.panel;
    const histogram = after?.histogram ?? before?.histogram;
    const bins = histogram?.counts?.length ?? 0;
    const low = histogram?.low ?? 0;
    const step = ((histogram?.high ?? 1) - low) / Math.max(1, bins);
    const beforeShares = sharesOf(before?.histogram);
    const afterShares = sharesOf(after?.histogram);
    return (
        <details class="as-table">
            <summary>
                As a table<span class="sr">: {props.panel.title}</span>
            </summary>
            <div class="scroll" tabIndex={0} role="group" aria-label={`Table: ${props.panel.title}`}>
                <table>
                    <thead>
                        <tr>
                            <th scope="col">From</th>
                            <th scope="col">To</th>
                            {before && (
                                <th scope="col" class="right">
                                    before
                                </th>
                            )}
                            <th scope="col" class="right">
                                {props.panel.afterLabel}
                            </th>
                        </tr>
                    </thead>
                    <tbody>
                        {Array.from({ length: bins }, (_, i) => (
                            <tr key={i}>
                                <td>{number(low + i * step)}</td>
                                <td>{number(low + (i + 1) * step)}</td>
                                {before && <td class="right">{percent(beforeShares[i])}</td>}
                                <td class="right">{percent(afterShares[i])}</td>
                            </tr>
                        ))}
                    </tbody>
                </table>
            </div>
        </details>
    );
}

function sharesOf(histogram: Histogram | undefined): number[] {
    const counts = (histogram?.counts ?? []).map(Number);
    const total = counts.reduce((a, b) => a + b, 0) || 1;
    return counts.map((value) => value / total);
}

function highest(histogram: Histogram | undefined): number {
    return Math.max(0, ...sharesOf(histogram));
}
