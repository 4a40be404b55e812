function rows = table(agent, varargin)
%TABLE  Measure a learner over many runs, and print the results as the report does.
%   rows = upright.table() makes the report's Table II: 20 runs of Q-learning without noise. It
%   prints a line for each run as it ends, followed by the table.
%   rows = upright.table(agent, name, value, ...) measures 'q-learning' or 'reinforce', and changes
%   these options:
%
%     'noises'    'none' (default), 'all': the seven published cases, or a cell of names
%     'quiet'     whether only the table is printed (default false)
%     'runs', 'start', 'steps', 'trials', 'seed', 'settings', 'mex'
%                 as in upright.run_trials
%
%   The baseline is random guessing: a new linear policy for every trial, which learns nothing. A
%   learner that needs as many trials has not been shown to learn. The brackets contain 95 %
%   intervals: Wilson's for the success rate, and a bootstrap interval (BCa) for the mean number of
%   trials over the successful runs. Every trial counts, including the successful one; failed runs
%   are shown.
%
%   rows is a struct array, one for each noise case: noise, runs, successes, success_ci95,
%   mean_trials, ci95, median_trials, max_trials, guess (the same of random guessing), published
%   (mean trials by source).
%
%   Example: the seven cases
%     rows = upright.table('q-learning', 'noises', 'all', 'runs', 100);
%
%   See also upright.run_trials, upright.build_mex.
    if nargin < 1
        agent = 'q-learning';
    end
    upright.internal.require_one_of('agent', agent, {'q-learning', 'reinforce'});
    defaults = rmfield(upright.internal.task_options(), 'noise');
    defaults.runs = 20;
    defaults.settings = upright.settings(agent);
    defaults.mex = 'built';
    defaults.noises = 'none';
    defaults.quiet = false;
    chosen = upright.internal.options(defaults, varargin);
    noises = noise_cases(chosen.noises);
    shared = {};
    for name = {'runs', 'start', 'steps', 'trials', 'seed'}
        shared = [shared, name, {chosen.(name{1})}]; %#ok<AGROW>
    end

    rows = cell(1, numel(noises));
    for k = 1:numel(noises)
        on_noise = [shared, {'noise', noises{k}}];
        say(chosen, '%s, %s:\n', agent, noise_title(noises{k}));
        learned = upright.run_trials(agent, on_noise{:}, 'settings', chosen.settings, ...
            'mex', chosen.mex, 'on_run', @(result) tell(chosen, result));
        row = upright.internal.summarise(learned);
        say(chosen, 'Average number of trials to success is %.1f\n\n', row.mean_trials);
        guessed = upright.run_trials('random-search', on_noise{:});
        row.guess = upright.internal.summarise(guessed);
        row.published = upright.internal.published(agent, noises{k});
        rows{k} = row;
    end
    rows = [rows{:}];
    print_rows(agent, rows, chosen);
end

function noises = noise_cases(noises)
    if strcmp(noises, 'all')
        [~, noises] = upright.noise_case();
    elseif ischar(noises)
        noises = {noises};
    end
    if ~iscell(noises) || isempty(noises)
        error('upright:badValue', 'noises is %s; it must be a name, ''all'', or a cell of names', ...
            upright.internal.shown(noises));
    end
    for k = 1:numel(noises)
        upright.noise_case(noises{k});                 % refuse an unknown one before any run
    end
end

function say(chosen, varargin)
    if ~chosen.quiet
        fprintf(varargin{:});
        upright.internal.flush();
    end
end

function tell(chosen, result)
    if result.success
        say(chosen, 'Success at %d trials with %d time steps\n', ...
            result.trials, result.lengths(end));
    else
        say(chosen, 'No success in %d trials; the longest had %d time steps\n', ...
            result.trials, max(result.lengths));
    end
end

function title = noise_title(noise)
    % The report's names.
    titles = {
        'none', 'Noise free'
        'actuator-5', 'Uniform 5 % Actuator Noise'
        'actuator-10', 'Uniform 10 % Actuator Noise'
        'sensor-5', 'Uniform 5 % Sensor Noise'
        'sensor-10', 'Uniform 10 % Sensor Noise'
        'gaussian-0.1', '0.1 Variance Gaussian sensor Noise'
        'gaussian-0.2', '0.2 Variance Gaussian sensor Noise'};
    title = noise;
    known = strcmp(noise, titles(:, 1));
    if any(known)
        title = titles{known, 2};
    end
end

function print_rows(agent, rows, chosen)
    sources = fieldnames(rows(1).published)';
    runs = rows(1).runs;
    head = [{'Noise Type', 'Success Rate', sprintf('No of Trials (%d runs)', runs), ...
        'Random guessing'}, strrep(sources, '_', ' ')];
    cells = cell(numel(rows), numel(head));
    for k = 1:numel(rows)
        cells(k, 1:4) = {noise_title(rows(k).noise), rate_text(rows(k)), mean_text(rows(k)), ...
            guess_text(rows(k).guess)};
        for j = 1:numel(sources)
            cells{k, 4 + j} = number_text(rows(k).published.(sources{j}));
        end
    end
    widths = max(cellfun(@numel, [head; cells]), [], 1);
    rule = arrayfun(@(width) repmat('-', 1, width + 2), widths, 'UniformOutput', false);
    lines = [{line_of(head, widths)}, {['|' strjoin(rule, '|') '|']}];
    for k = 1:numel(rows)
        lines{end + 1} = line_of(cells(k, :), widths); %#ok<AGROW>
    end
    fprintf('%s\n', lines{:});
    fprintf(['%s: average results. Cart pole being balanced for %d time steps; at most %d trials ' ...
        'a run, start %s, seed %d.\n95 %% intervals are in brackets.\n'], ...
        agent, chosen.steps, chosen.trials, chosen.start, chosen.seed);
    upright.internal.flush();
end

function text = line_of(cells, widths)
    padded = cellfun(@(cell, width) sprintf('%-*s', width, cell), cells, num2cell(widths), ...
        'UniformOutput', false);
    text = ['| ' strjoin(padded, ' | ') ' |'];
end

function text = rate_text(row)
    text = sprintf('%.0f %% [%.0f, %.0f]', 100 * row.successes / row.runs, 100 * row.success_ci95);
end

function text = mean_text(row)
    text = '-';
    if row.successes > 0
        text = sprintf('%.1f [%.1f, %.1f]', row.mean_trials, row.ci95);
    end
end

function text = guess_text(row)
    text = mean_text(row);
    if row.successes < row.runs
        text = sprintf('%s (%.0f %%)', text, 100 * row.successes / row.runs);
    end
end

function text = number_text(value)
    text = '-';
    if ~isnan(value)
        text = sprintf('%g', value);
    end
end

%!test
%! text = evalc ("rows = upright.table ('q-learning', 'runs', 4, 'steps', 300, 'seed', 1, 'mex', false);");
%! assert (numel (strfind (text, 'Success at ')), 4);
%! assert (! isempty (strfind (text, sprintf ('Average number of trials to success is %.1f', rows.mean_trials))));
%! assert (! isempty (strfind (text, '| Noise free | 100 % [51, 100] |')));
%! assert (rows.published.Report, 42);
%! assert (rows.guess.successes, 4);
%!test  # a run that fails is shown
%! text = evalc ("rows = upright.table ('reinforce', 'runs', 2, 'trials', 1, 'noises', {'sensor-5'});");
%! assert (! isempty (strfind (text, 'No success in 1 trials')));
%! assert (! isempty (strfind (text, '| Uniform 5 % Sensor Noise | 0 % [0, 66] ')));
%! assert (rows.mean_trials, NaN);
%!error id=upright:badValue upright.table ('random-search')
%!error <noise is 'storm'> upright.table ('q-learning', 'noises', {'none', 'storm'})
%!error <runs is 0> upright.table ('q-learning', 'runs', 0)
