function result = q_learning(varargin)
%Q_LEARNING  Learn to balance by tabular Q-learning: one run, step by step.
%   result = upright.q_learning() runs a learner that knows nothing about the physics: it balances,
%   falls and learns, trial after trial, until a trial lasts 60,000 steps of 0.02 s.
%   result = upright.q_learning(name, value, ...) changes these options:
%
%     'noise'     noise case (default 'none'; see upright.noise_case)
%     'start'     'random': each of the four within +-0.05 (default), 'zero', or 'wide'
%     'steps'     N: a trial of this many steps succeeds (default 60000)
%     'trials'    a run is at most this many trials (default 1000)
%     'seed'      the same seed gives the same run (default 0)
%     'run'       number of the run, from 1; each has its own random numbers (default 1)
%     'settings'  from upright.settings('q-learning')
%     'watch'     function called after each step, go_on = watch(moment), with the fields trial,
%                 step, state, force and fallen; the run ends once it returns false
%
%   result has the fields success, trials (how many there were), lengths (steps of each), policy
%   (what was learned, see upright.simulate) and the options of the run.
%
%   The measurements are cut into boxes. A table holds the expected value of each push in each
%   box: 0 if the pole stays up, -gamma^k if it falls after k more moves. Each move from box b to
%   b' under push a changes this value, by the report's equation (2):
%
%     Q(b, a) <- (1 - alpha) Q(b, a) + alpha (r + gamma max_a' Q(b', a')),   r = -1 at the fall
%
%   With the 'as-published' settings, this happens at every step. The tuned settings store the
%   moves from box to box and replay them backwards after a fall (Lin, 1992).
%
%   Example:
%     result = upright.q_learning('noise', 'gaussian-0.1', 'seed', 3);
%     upright.plot_learning(result);
%
%   upright.run_trials makes many such runs at once. It is fast and gives the same results.
%
%   See also upright.reinforce, upright.run_trials, upright.animate.
    [chosen, task, draw] = upright.internal.begin_run('q-learning', varargin);
    s = chosen.settings;
    p = task.parameters;
    boxes = upright.internal.make_boxes(s);
    places = upright.internal.table_places(s);         % of each box: push left, push right
    table = s.jitter * (draw(numel(places)) - 0.5);
    FALL = 0;                                          % stands for the box that a fall leads to
    moves = zeros(s.replay_size, 2);                   % where the table has it, box it led to
    moved = 0;                                         % how many moves there were: it is a ring

    lengths = [];
    success = false;
    watched = true;
    while ~success && watched && numel(lengths) < task.trials
        state = upright.internal.draw_start(task.start, draw);
        observation = upright.measure(task.noise, state, draw);
        box = upright.internal.find_box(boxes, observation);
        fallen = false;
        step = 0;
        while step < task.steps && ~fallen && watched
            % Act: choose the push with the larger value.
            right = table(places(box, 2)) > table(places(box, 1));
            force = upright.disturb(task.noise, p.force * (2 * right - 1), draw);
            state = upright.step(p, state, force);
            fallen = upright.has_fallen(p, state);
            observation = upright.measure(task.noise, state, draw);
            step = step + 1;

            % Learn from the move, or keep it until the pole has fallen.
            next = FALL;
            if ~fallen
                next = upright.internal.find_box(boxes, observation);
            end
            if s.replay_passes == 0
                change(places(box, 1 + right), one_step_value(next));
            elseif next ~= box
                moves(1 + mod(moved, s.replay_size), :) = [places(box, 1 + right), next];
                moved = moved + 1;
            end
            box = next;
            watched = upright.internal.watch(chosen, numel(lengths) + 1, step, state, force, fallen);
        end
        if fallen
            for pass = 1:s.replay_passes
                replay();
            end
        end
        if watched
            lengths(end + 1) = step; %#ok<AGROW>
            success = ~fallen;
        end
    end
    policy = upright.internal.table_policy(s, table);
    result = upright.internal.end_run('q-learning', chosen, success, lengths, policy);

    function value = one_step_value(next)
        % The reward and the discounted value of where a move led.
        if next == FALL
            value = -1;
        else
            value = s.discount * max(table(places(next, 1)), table(places(next, 2)));
        end
    end

    function change(place, value)
        table(place) = table(place) + s.learning_rate * (value - table(place));
    end

    function replay()
        % Learn from the kept moves, the newest first; part of what the next move was worth is
        % passed on to the one before.
        value = 0;
        for k = moved - 1:-1:max(0, moved - s.replay_size)
            move = moves(1 + mod(k, s.replay_size), :);
            one_step = one_step_value(move(2));
            if move(2) == FALL
                value = one_step;
            else
                value = (1 - s.trace_decay) * one_step + s.trace_decay * s.discount * value;
            end
            change(move(1), value);
        end
    end
end

%!test  # it learns, and the same seed gives the same run
%! result = upright.q_learning ('steps', 500, 'seed', 1);
%! assert (result.success);
%! assert (result.lengths(end), 500);
%! assert (all (result.lengths(1:end - 1) < 500));
%! again = upright.q_learning ('steps', 500, 'seed', 1);
%! assert (again.lengths, result.lengths);
%! assert (! isequal (upright.q_learning ('steps', 500, 'seed', 2), result));
%!test  # alpha = 0 learns nothing
%! s = upright.settings ('q-learning');
%! s.learning_rate = 0;
%! result = upright.q_learning ('settings', s, 'trials', 30, 'start', 'zero');
%! assert (result.lengths, result.lengths(1) * ones (1, 30));
%!test  # who watches can stop it
%! result = upright.q_learning ('watch', @(moment) moment.trial < 3);
%! assert ([result.success, result.trials], [0, 2]);
%!error <learning_rate is 2> upright.q_learning ('settings', setfield (upright.settings ('q-learning'), 'learning_rate', 2))
%!error <noise is 'storm'> upright.q_learning ('noise', 'storm')
%!error id=upright:badOption upright.q_learning ('alpha', 0.3)
