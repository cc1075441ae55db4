import { useState } from 'preact/hooks';

import { api } from '../api';
import { navigate, path } from '../router';

export function SignInPage(props: { onSignedIn: () => void }) {
    const [token, setToken] = useState('');
    const [problem, setProblem] = useState('');
    const [isBusy, setBusy] = useState(false);

    const submit = async (event: Event) => {
        event.preventDefault();
        setBusy(true);
        try {
            await api.signIn(token.trim());
            setProblem('');
            props.onSignedIn();
            if (path() === '/sign-in') {
                navigate('/');
            }
        } catch (error) {
            setProblem(error instanceof Error ? error.message : String(error));
        } finally {
            setBusy(false);
        }
    };

    return (
        <section class="sign-in">
            <h1 tabIndex={-1}>Sign in</h1>
            <p>
                This server asks for a token. Whoever runs it makes one with <code>remeshd admin</code>; it stays in a
                cookie that scripts can't read until you close the browser.
            </p>
            <form onSubmit={submit}>
                <label>
                    Token
                    <input
                        type="password"
                        autocomplete="current-password"
                        required
                        value={token}
                        onInput={(event) => setToken(event.currentTarget.value)}
                    />
                </label>
                {problem && (
                    <p class="problem" role="alert">
                        {problem}
                    </p>
                )}
                <button class="primary" disabled={isBusy}>
                    Sign in
                </button>
            </form>
        </section>
    );
}
