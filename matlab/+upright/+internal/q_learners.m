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
    rows_of_table = entries + 1;                       % the last one stands for nothing
    table = [s.jitter * (random((1:count)', entries)' - 0.5); zeros(1, count)];
    FALL = 0;                                          % stands for the box that a fall leads to
    box = zeros(count, 1);                             % in which each run is
    move_places = zeros(s.replay_size, count);         % where the table has a move: a ring
    move_boxes = zeros(s.replay_size, count);          % the box it led to
    moved = zeros(count, 1);                           % how many moves there were

    learners = struct('begin_trial', @begin_trial, 'act', @act, 'learn', @learn, ...
        'end_trial', @end_trial, 'policy', @policy, 'forget', @forget, ...
        'patience', 500 * (s.replay_passes > 0));

    function begin_trial(runs, observation)
        box(runs) = upright.internal.find_box(boxes, observation);
    end

    function right = act(runs, ~)
        now = box(runs);
        offset = (runs - 1) * rows_of_table;
        right = table(places(now + to_right) + offset) > table(places(now) + offset);
    end

    function learn(runs, right, observation, fallen)
        before = box(runs);
        next = upright.internal.find_box(boxes, observation);
        next(fallen) = FALL;
        box(runs) = next;
        if s.replay_passes == 0
            offset = (runs - 1) * rows_of_table;
            change(places(before + to_right * right) + offset, one_step_value(next, offset));
            return
        end
        moves = next ~= before;
        if any(moves)
            runs = runs(moves);
            now = moved(runs);
            moved(runs) = now + 1;
            rows = mod(now, s.replay_size) + 1 + (runs - 1) * s.replay_size;
            move_places(rows) = places(before(moves) + to_right * right(moves));
            move_boxes(rows) = next(moves);
        end
    end

    function end_trial(runs)
        if s.replay_passes > 0
            replay(runs);
        end
    end

    function made = policy(run)
        made = upright.internal.table_policy(s, table(1:entries, run)');
    end

    function forget()
        table = [];
        move_places = [];
        move_boxes = [];
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

    function replay(runs)
        % Go through the kept moves backwards, those of all runs at once, a column for each move.
        % All that can be known before any value changes is looked up first. A run with fewer moves
        % than others spends the rest of the time on an entry of the table that nobody reads.
        kept = min(moved(runs), s.replay_size);
        back = 1:max(kept);
        rows = mod(moved(runs) - back, s.replay_size) + 1 + (runs - 1) * s.replay_size;
        next = reshape(move_boxes(rows), size(rows));
        fell = next == FALL;
        next(fell) = 1;                                % any box
        idle = back > kept;
        next(idle) = 1;
        fell(idle) = false;
        offset = (runs - 1) * rows_of_table;
        left = reshape(places(next), size(rows)) + offset;
        right = reshape(places(next + to_right), size(rows)) + offset;
        place = reshape(move_places(rows), size(rows));
        place(idle) = rows_of_table;
        place = place + offset;
        some_fell = any(fell, 1);

        keep = 1 - s.trace_decay;
        pass_on = s.trace_decay * s.discount;
        for pass = 1:s.replay_passes
            value = zeros(numel(runs), 1);
            for k = back
                best = max(table(left(:, k)), table(right(:, k)));
                value = keep * (s.discount * best) + pass_on * value;
                if some_fell(k)
                    value(fell(:, k)) = -1;
                end
                where = place(:, k);
                now = table(where);
                table(where) = now + s.learning_rate * (value - now);
            end
        end
    end
end
