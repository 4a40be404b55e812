function window = plot_learning(results, varargin)
%PLOT_LEARNING  Draw learning curves: how many steps each trial lasted.
%   window = upright.plot_learning(results) draws a thin line for each run, its trials counted from
%   1, and marks trials that succeeded. If there are several runs, their median is bold. After a
%   run has succeeded, all its later trials count as successes in the median; a run that failed
%   no longer counts after its last trial. results is what upright.run_trials, upright.q_learning,
%   upright.reinforce or upright.animate return. window is the handle of the figure.
%   window = upright.plot_learning(results, 'file', name) writes the picture, 'name.png', 'name.pdf'
%   or 'name.svg', and needs no display. The figure stays invisible; without an output argument it
%   is deleted.
%
%   Example:
%     results = upright.run_trials('q-learning', 'noise', 'gaussian-0.1');
%     upright.plot_learning(results);
%     upright.plot_learning(results, 'file', 'curves.png');
%
%   See also upright.run_trials, upright.animate.
    chosen = upright.internal.options(struct('file', ''), varargin);
    check_results(results);
    if isequal(chosen.file, '')
        window = figure('Color', 'w');
        draw(window, results, 1);
    else
        upright.internal.check_output('file', chosen.file, {'.png', '.pdf', '.svg'});
        [~, ~, ending] = fileparts(chosen.file);
        finer = 1 + strcmp(ending, '.png');            % for smooth edges
        window = upright.internal.new_figure(false, 720 * finer, 440 * finer);
        wanted = nargout > 0;
        tidy = onCleanup(@() delete_unless(wanted, window));
        draw(window, results, finer);
        upright.internal.write_whole(chosen.file, @(part) write(window, part, finer));
    end
    if nargout == 0
        clear('window');
    end
end

function check_results(results)
    needed = {'agent', 'noise', 'steps', 'success', 'trials', 'lengths'};
    if ~isstruct(results) || ~all(isfield(results, needed))
        error('upright:badResults', ...
            'results are %s; they must be what upright.run_trials or a learner returns', ...
            upright.internal.shown(results));
    end
    if sum([results.trials]) == 0
        error('upright:badResults', 'results have no trial that ended; there is nothing to draw');
    end
end

function draw(window, results, finer)
    c = upright.internal.colours();
    points = upright.internal.font_size(window, 14 * finer);
    scale = upright.internal.steps_axis();
    room = axes('Parent', window, 'Units', 'normalized', 'Position', [0.12 0.14 0.84 0.72], ...
        scale{:}, 'XColor', c.ink, 'YColor', c.ink, 'Color', c.paper, 'Box', 'off', ...
        'FontSize', points, 'LineWidth', 0.7 * finer, 'TickLength', [0.008 0.008], ...
        'YGrid', 'on', 'YMinorGrid', 'off', 'GridLineStyle', '-', 'GridColor', c.faint);
    if isprop(room, 'GridAlpha')
        set(room, 'GridAlpha', 1);
    end
    stroke = upright.internal.stroke(window, finer);
    longest = max([results.trials]);
    most = max([results.steps]);
    set(room, 'XLim', [0.5, longest + 0.5], 'YLim', [1, 2 * most]);
    if longest <= 12
        set(room, 'XTick', 1:longest);
    end
    several = numel(results) > 1;

    plot_runs(room, results, several, stroke);
    line('Parent', room, 'XData', [0.5, longest + 0.5], 'YData', [most, most], ...
        'Color', c.good, 'LineStyle', '--', 'LineWidth', stroke);
    if several
        line('Parent', room, 'XData', 1:longest, 'YData', median_run(results), 'Color', c.ink, ...
            'LineWidth', 2.4 * stroke);
    end
    won = results([results.success]);
    if ~isempty(won)
        line('Parent', room, 'XData', [won.trials], 'YData', [won.steps], 'LineStyle', 'none', ...
            'Marker', 'o', 'MarkerSize', 5.5 * stroke, 'MarkerFaceColor', c.good, ...
            'MarkerEdgeColor', c.good);
    end
    labels(room, results, points);
end

function plot_runs(room, results, several, stroke)
    % One line for all runs, with gaps between, is drawn quickly.
    c = upright.internal.colours();
    x = [];
    y = [];
    for k = 1:numel(results)
        x = [x, 1:results(k).trials, NaN]; %#ok<AGROW>
        y = [y, reshape(results(k).lengths, 1, []), NaN]; %#ok<AGROW>
    end
    colour = c.cart;
    width = 1.4;
    if several
        colour = 0.55 * c.cart + 0.45 * c.paper;
        width = 0.7;
    end
    line('Parent', room, 'XData', x, 'YData', y, 'Color', colour, ...
        'LineWidth', width * stroke, 'Marker', 'o', 'MarkerSize', (3.6 - several) * stroke, ...
        'MarkerFaceColor', colour, 'MarkerEdgeColor', colour);
end

function middle = median_run(results)
    longest = max([results.trials]);
    lengths = NaN(numel(results), longest);
    for k = 1:numel(results)
        lengths(k, 1:results(k).trials) = results(k).lengths;
        if results(k).success
            lengths(k, results(k).trials + 1:end) = results(k).steps;
        end
    end
    middle = zeros(1, longest);
    for trial = 1:longest
        there = lengths(~isnan(lengths(:, trial)), trial);
        middle(trial) = median(there);
    end
end

function labels(room, results, points)
    c = upright.internal.colours();
    agents = unique({results.agent});
    noises = unique({results.noise});
    told = sprintf('%s, noise: %s', strjoin(agents, ' and '), strjoin(noises, ' and '));
    if numel(results) > 1
        told = sprintf('%s: %d of %d runs succeeded', told, sum([results.success]), numel(results));
    end
    style = {'FontSize', points, 'Color', c.ink};
    legend_of = 'green: the trial that succeeded';
    if numel(results) > 1
        legend_of = 'thin: each run    bold: their median    green: trials that succeeded';
    end
    above = {'Parent', room, 'Units', 'normalized', 'FontSize', points, ...
        'HorizontalAlignment', 'center', 'VerticalAlignment', 'baseline'};
    text(0.5, 1.11, told, above{:}, 'Color', c.ink, 'FontWeight', 'bold');
    text(0.5, 1.035, legend_of, above{:}, 'Color', c.grey);
    xlabel(room, 'number of the trial', style{:});
    ylabel(room, 'length of the trial (steps of 0.02 s)', style{:});
end

function write(window, file, finer)
    [~, ~, ending] = fileparts(file);
    if strcmp(ending, '.png')
        imwrite(upright.internal.picture_of(window, finer), file);
        return
    end
    % A page of the picture's size.
    size_now = [7.2 4.4];
    set(window, 'PaperUnits', 'inches', 'PaperSize', size_now, 'PaperPosition', [0 0 size_now]);
    print(window, ['-d', ending(2:end)], file);
end

function delete_unless(wanted, window)
    if ~wanted && ishghandle(window)
        delete(window);
    end
end

%!function results = sample ()
%!  results = struct ('agent', 'q-learning', 'noise', 'none', 'steps', 100, 'success', {true, false, true}, 'trials', {3, 2, 1}, 'lengths', {[9 40 100], [5 8], 100});
%!endfunction
%!test  # every kind of file; a picture that is not blank
%! before = get (0, 'children');
%! for ending = {'.png', '.pdf', '.svg'}
%!   file = [tempname() ending{1}];
%!   unwind_protect
%!     upright.plot_learning (sample (), 'file', file);
%!     assert (stat (file).size > 3000);
%!     if (strcmp (ending{1}, '.png'))
%!       pixels = imread (file);
%!       assert (size (pixels), [440 720 3]);
%!       assert (numel (unique (pixels)) > 20);
%!     end
%!   unwind_protect_cleanup
%!     delete (file);
%!   end_unwind_protect
%! end
%! assert (get (0, 'children'), before);
%!test  # the figure holds the runs, and the median of those that are there
%! file = [tempname() '.png'];
%! window = upright.plot_learning (sample (), 'file', file);
%! unwind_protect
%!   lines = findobj (window, 'type', 'line');
%!   data = get (lines, 'ydata');
%!   assert (any (cellfun (@(y) isequaln (y, [9 40 100 NaN 5 8 NaN 100 NaN]), data)));
%!   assert (any (cellfun (@(y) isequal (y, [9 40 100]), data)));
%! unwind_protect_cleanup
%!   delete (window);
%!   delete (file);
%! end_unwind_protect
%!error id=upright:badResults upright.plot_learning (3)
%!error id=upright:badResults upright.plot_learning (struct ('success', true))
%!error <no trial> upright.plot_learning (sample ()([]))
%!error <ending of 'a.txt'> upright.plot_learning (sample (), 'file', 'a.txt')
%!error id=upright:badOption upright.plot_learning (sample (), 'colour', 'red')
