function learners = q_learners(s, count, random)
%Q_LEARNERS  Tabular Q-learning of many runs in lockstep; upright.q_learning explains the rule.
%   learners = upright.internal.q_learners(settings, count, random) returns what
%   upright.internal.lockstep takes. All that is remembered has a column for each run.
%
%   Example:
%     random = upright.internal.random_streams(1:5);
%     learners = upright.internal.q_learners(upright.settings('q-learning'), 5, random);
    boxes = upright.internal.make_boxes(s);
    places = upright.internal.table_places(s);         % of box b: b and, right, b + boxes.count
    to_right = boxes.count;
    entries = numel(places);
    table = s.jitter * (random((1:count)', entries)' - 0.5);
    FALL = 0;                                          % stands for the box that a fall leads to
    box = zeros(count, 1);                             % in which each run is
    move_places = zeros(s.kept_moves, count);          % where the table has a move: a ring
    move_boxes = zeros(s.kept_moves, count);           % the box it led to
    moved = zeros(count, 1);                           % how many moves there were

    learners = struct('begin_trial', @begin_trial, 'act', @act, 'learn', @learn, ...
        'end_trial', @end_trial, 'policy', @policy, 'patience', 200 * (s.passes > 0));

    function begin_trial(runs, observation)
        box(runs) = upright.internal.find_box(boxes, observation);
    end

    function right = act(runs, ~)
        now = box(runs);
        offset = (runs - 1) * entries;
        right = table(places(now + to_right) + offset) > table(places(now) + offset);
    end

    function learn(runs, right, observation, fallen)
        before = box(runs);
        next = upright.internal.find_box(boxes, observation);
        next(fallen) = FALL;
        box(runs) = next;
        if s.passes == 0
            offset = (runs - 1) * entries;
            change(places(before + to_right * right) + offset, one_step_value(next, offset));
            return
        end
        moves = next ~= before;
        if any(moves)
            runs = runs(moves);
            now = moved(runs);
            moved(runs) = now + 1;
            rows = mod(now, s.kept_moves) + 1 + (runs - 1) * s.kept_moves;
            move_places(rows) = places(before(moves) + to_right * right(moves));
            move_boxes(rows) = next(moves);
        end
    end

    function end_trial(runs)
        if s.passes > 0
            kept = min(moved(runs), s.kept_moves);
            [kept, order] = sort(kept, 'descend');     % so that the runs with a move come first
            replay(runs(order), kept);
        end
    end

    function made = policy(run)
        made = upright.internal.table_policy(s, table(:, run)');
    end

    function value = one_step_value(next, offset)
        % The reward and the discounted value of where each move led.
        fell = next == FALL;
        next(fell) = 1;                                % any box
        value = s.discount * max(table(places(next) + offset), ...
            table(places(next + to_right) + offset));
        value(fell) = -1;
    end

    function change(place, value)
        now = table(place);
        table(place) = now + s.learning_rate * (value - now);
    end

    function replay(runs, kept)
        % Go through the kept moves backwards, those of all runs at once, a column for each move.
        % All that can be known before any value changes is looked up first.
        offset = (runs - 1) * entries;
        back = 1:kept(1);
        rows = 1 + mod(moved(runs) - back, s.kept_moves) + (runs - 1) * s.kept_moves;
        place = reshape(move_places(rows), size(rows)) + offset;
        next = reshape(move_boxes(rows), size(rows));
        fell = next == FALL;
        next(fell) = 1;
        left = reshape(places(next), size(rows)) + offset;
        right = reshape(places(next + to_right), size(rows)) + offset;
        some_fell = any(fell, 1);
        having = sum(kept >= back, 1);      % how many runs have so many moves

        keep = 1 - s.trace;
        pass_on = s.trace * s.discount;
        for pass = 1:s.passes
            value = zeros(numel(runs), 1);
            for k = back
                some = 1:having(k);
                best = max(table(left(some, k)), table(right(some, k)));
                value = keep * (s.discount * best) + pass_on * value(some);
                if some_fell(k)
                    value(fell(some, k)) = -1;
                end
                where = place(some, k);
                now = table(where);
                table(where) = now + s.learning_rate * (value - now);
            end
        end
    end
end
