import type { Defect, Quality, Warning } from '../api';
import { count, number } from '../format';

const readable = (code: string) => code.toLowerCase().replaceAll('_', ' ');

/** What a person should know, but for what is told as a repair further down. */
export function Warnings(props: { warnings: Warning[]; told: Defect[] }) {
    const told = new Set(props.told.map((defect) => defect.code));
    const warnings = props.warnings.filter((warning) => !told.has(warning.code));
    if (warnings.length === 0) {
        return null;
    }
    return (
        <ul class="notice warning" aria-label="Warnings">
            {warnings.map((warning, i) => (
                <li key={i}>
                    <strong>{readable(warning.code)}</strong> {warning.message}
                </li>
            ))}
        </ul>
    );
}

/** What was wrong with the input, and what was done about it. */
export function Defects(props: { quality: Quality }) {
    const defects = props.quality.defects ?? [];
    return (
        <section aria-labelledby="defects-title">
            <div class="section-title">
                <h2 id="defects-title">Found and repaired</h2>
            </div>
            {defects.length === 0 ? (
                <p class="card nothing">Nothing was wrong with this surface.</p>
            ) : (
                <ul class="card defects">
                    {defects.map((defect, i) => (
                        <li key={i}>
                            <span class="badge">{count(defect.count)}</span>
                            <div>
                                <strong>{readable(defect.code)}</strong>
                                <p>{defect.description}</p>
                                {defect.at && defect.at.length === 3 && (
                                    <small class="muted">at {defect.at.map((x) => number(x, 4)).join(', ')}</small>
                                )}
                            </div>
                        </li>
                    ))}
                </ul>
            )}
        </section>
    );
}
