function lockstep(learners, task, random, count, on_end)
%LOCKSTEP  The loop: runs of trials, all cart-poles advancing together.
%   upright.internal.lockstep(learners, task, random, count, on_end)
%
%     learners  struct of functions, for the runs in a column of their indices:
%                 begin_trial(runs, observation)
%                 right = act(runs, observation)             push right, not left?
%                 learn(runs, right, observation, fallen)    after each step
%                 end_trial(runs)                            after falls
%                 policy(run)                                what was learned
%                 forget()                                   at the end: Octave never frees the
%                                                            memory of nested functions
%               and patience: how many steps a fallen run waits for others to fall, so that more
%               of them learn at once.
%     task      from upright.internal.make_task
%     random    from upright.internal.random_streams
%     count     number of runs
%     on_end    function called with run, success, lengths, policy as each run ends
%
%   A run does not depend on the others or on when it learns: each has its own random numbers.
%
%   Example: see upright.run_trials, which uses it.
    p = task.parameters;
    lengths = zeros(count, 16);
    ended = zeros(count, 1);                           % trials of each run
    resting = (1:count)';                              % between two trials
    waited = 0;                                        % steps that some of them have missed
    running = zeros(0, 1);                             % in a trial, a row each in what follows
    state = zeros(0, 4);
    observation = zeros(0, 4);
    steps = zeros(0, 1);
    begun = zeros(0, 1);                               % those that begin a trial now
    act = learners.act;
    learn = learners.learn;
    draw = @draw_for_running;
    patience = learners.patience;
    goal = task.steps;
    push = 2 * p.force;
    quiet = isequal(task.noise, upright.noise_case('none'));   % calls that do nothing cost time

    while ~isempty(running) || ~isempty(resting)
        if isempty(running) || (waited >= patience && ~isempty(resting))
            begin_trials();
            continue                                   % as all of them may have failed for good
        end
        right = act(running, observation);
        force = push * (right - 0.5);
        if quiet
            state = upright.step(p, state, force);
            observation = state;
        else
            state = upright.step(p, state, upright.disturb(task.noise, force, draw));
            observation = upright.measure(task.noise, state, draw);
        end
        fallen = upright.has_fallen(p, state);
        learn(running, right, observation, fallen);
        steps = steps + 1;
        over = fallen | steps >= goal;
        waited = waited + 1;
        if any(over)
            end_trials(over, fallen);
        end
    end
    learners.forget();

    function begin_trials()
        fell = resting(ended(resting) > 0);
        if ~isempty(fell)
            learners.end_trial(fell);
        end
        failed = fell(ended(fell) == task.trials);
        for run = failed'
            finish(run, false);
        end
        begun = resting(ended(resting) < task.trials);
        resting = zeros(0, 1);
        if isempty(begun)
            return
        end
        start = upright.internal.draw_start(task.start, @draw_for_begun);
        seen = upright.measure(task.noise, start, @draw_for_begun);
        learners.begin_trial(begun, seen);
        running = [running; begun];
        state = [state; start];
        observation = [observation; seen];
        steps = [steps; zeros(size(begun))];
    end

    function uniform = draw_for_begun(k)
        uniform = random(begun, k);
    end

    function uniform = draw_for_running(k)
        uniform = random(running, k);
    end

    function end_trials(over, fallen)
        runs = running(over);
        ended(runs) = ended(runs) + 1;
        if max(ended(runs)) > size(lengths, 2)
            lengths(:, 2 * end) = 0;
        end
        lengths(runs + (ended(runs) - 1) * count) = steps(over);
        for run = running(over & ~fallen)'
            finish(run, true);
        end
        if isempty(resting)
            waited = 0;
        end
        resting = [resting; running(over & fallen)];
        running = running(~over);
        state = state(~over, :);
        observation = observation(~over, :);
        steps = steps(~over);
    end

    function finish(run, success)
        on_end(run, success, lengths(run, 1:ended(run)), learners.policy(run));
    end
end
