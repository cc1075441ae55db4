import type { Job, Quality } from '../api';
import { count, number, percent, word } from '../format';

interface Row {
    name: string;
    before?: string;
    after: string;
}

/** The measures of the paper and the ones that solvers ask for. */
export function Measures(props: { quality: Quality }) {
    const { before, after, tets } = props.quality;
    const rows: Row[] = [
        { name: 'Triangles', before: count(before?.triangles), after: count(after?.triangles) },
        { name: 'Vertices of the surface', before: count(before?.vertices), after: count(after?.vertices) },
        { name: 'Parts', before: count(before?.components), after: count(after?.components) },
        { name: 'Euler characteristic', before: count(before?.euler_characteristic), after: count(after?.euler_characteristic) },
        { name: 'Area', before: number(before?.area, 4), after: number(after?.area, 4) },
        { name: 'Enclosed volume', before: number(before?.volume, 4), after: number(after?.volume, 4) },
        { name: 'Triangle radius ratio, mean', before: number(before?.radius_ratio?.mean), after: number(after?.radius_ratio?.mean) },
        { name: 'Triangle radius ratio, worst', before: number(before?.radius_ratio?.min ?? 0), after: number(after?.radius_ratio?.min ?? 0) },
        { name: 'Smallest triangle angle, degrees', before: number(before?.min_angle?.min ?? 0), after: number(after?.min_angle?.min ?? 0) },
        { name: 'Edge length, mean', before: number(before?.edge_length?.mean), after: number(after?.edge_length?.mean) },
    ];
    if (tets) {
        rows.push(
            { name: 'Tetrahedra', after: count(tets.tets) },
            { name: 'Volume of the tetrahedra', after: number(tets.volume, 4) },
            { name: 'Tetrahedron radius ratio, mean', after: number(tets.radius_ratio?.mean) },
            { name: 'Tetrahedron radius ratio, worst 1 %', after: number(tets.radius_ratio?.first_percentile) },
            { name: 'Dihedral angles, smallest, degrees', after: number(tets.dihedral?.min ?? 0) },
            { name: 'Dihedral angles, largest, degrees', after: number(tets.dihedral?.max) },
        );
    }
    const { output_to_input: there, input_to_output: back } = props.quality;
    rows.push(
        { name: 'Edge length asked for or chosen, h', after: number(props.quality.edge_length) },
        { name: 'Change of volume', after: percent(props.quality.volume_change ?? 0, 2) },
        { name: 'Distance result to input: rms, 99 %, largest', after: `${number(there?.rms)}, ${number(there?.p99)}, ${number(there?.max)}` },
        { name: 'Distance input to result: rms, 99 %, largest', after: `${number(back?.rms)}, ${number(back?.p99)}, ${number(back?.max)}` },
    );
    return (
        <section aria-labelledby="measures-title">
            <div class="section-title">
                <h2 id="measures-title">Measures</h2>
                <span class="muted">lengths in the units of the input</span>
            </div>
            <div class="card table-card scroll" tabIndex={0} role="group" aria-label="Measures">
                <table class="measures">
                    <thead>
                        <tr>
                            <th scope="col">Measure</th>
                            <th scope="col" class="right">
                                Before
                            </th>
                            <th scope="col" class="right">
                                After
                            </th>
                        </tr>
                    </thead>
                    <tbody>
                        {rows.map((row) => (
                            <tr key={row.name}>
                                <th scope="row">{row.name}</th>
                                <td class="right">{row.before ?? ''}</td>
                                <td class="right">{row.after}</td>
                            </tr>
                        ))}
                    </tbody>
                </table>
            </div>
        </section>
    );
}

/** How it was made: enough to make it again. */
export function Made(props: { job: Job }) {
    const { job } = props;
    const provenance = job.result?.provenance;
    const rows: [string, string][] = [
        ['Job', job.name],
        ['Created', new Date(job.create_time).toLocaleString()],
        ['Input, SHA-256', job.spec.input.digest?.sha256 ?? ''],
        ['Unit', word(job.spec.input.frame?.unit) || 'not said'],
        ['Space', word(job.spec.input.frame?.space).toUpperCase() || 'not said'],
    ];
    if (provenance) {
        rows.push(['Engine', provenance.engine_version ?? '']);
    }
    return (
        <section aria-labelledby="made-title">
            <div class="section-title">
                <h2 id="made-title">Provenance</h2>
            </div>
            <div class="card made">
                <dl>
                    {rows.map(([name, value]) => (
                        <div key={name}>
                            <dt>{name}</dt>
                            <dd>{value}</dd>
                        </div>
                    ))}
                </dl>
                <details>
                    <summary>{provenance ? 'Options, defaults filled in' : 'Options asked for'}</summary>
                    <pre tabIndex={0}>{JSON.stringify(provenance?.options ?? job.spec.options ?? {}, null, 2)}</pre>
                </details>
            </div>
        </section>
    );
}
