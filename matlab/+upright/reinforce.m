function result = reinforce(varargin)
%REINFORCE  Learn to balance by policy gradient: one run, step by step.
%   result = upright.reinforce() trains the report's 4-8-16-1 network: it balances, falls and
%   learns, trial after trial, until a trial lasts 60,000 steps of 0.02 s.
%   result = upright.reinforce(name, value, ...) changes the same options as upright.q_learning:
%   'noise', 'start', 'steps', 'trials', 'seed', 'run', 'settings' (from
%   upright.settings('reinforce')) and 'watch'. result also has the same fields.
%
%   The network turns a measurement into the probability of a push to the right, and the push is
%   sampled from it. After a fall, pushes after which the pole stayed up longer than expected are
%   made more likely, and the others less likely (R. J. Williams, Machine Learning 8, 1992):
%
%     gradient = mean over steps of  A_t grad log pi(a_t | o_t),   A_t = (G_t - V(o_t)) / RMS
%
%   where G_t = -gamma^(T-1-t) is the discounted return of a reward of -1 at the fall, in an
%   episode of T steps. upright.internal.policy_gradient makes the update.
%
%   Example:
%     result = upright.reinforce('noise', 'actuator-10', 'seed', 3);
%     upright.plot_learning(result);
%
%   See also upright.q_learning, upright.run_trials, upright.animate.
    [chosen, task, draw] = upright.internal.begin_run('reinforce', varargin);
    s = chosen.settings;
    p = task.parameters;
    scales = upright.internal.scales_of(s);
    memory = upright.internal.new_network(s, draw(176));

    lengths = [];
    success = false;
    watched = true;
    while ~success && watched && numel(lengths) < task.trials
        state = upright.internal.draw_start(task.start, draw);
        observation = upright.measure(task.noise, state, draw);
        inputs = zeros(s.kept_steps, 4);               % the episode's last steps: a ring
        pushes = false(s.kept_steps, 1);
        probabilities = zeros(s.kept_steps, 1);        % of the push that was made
        fallen = false;
        step = 0;
        while step < task.steps && ~fallen && watched
            % Act: sample a push.
            input = observation ./ scales;
            probability = upright.internal.evaluate_network(memory.weights, s.logit_scale, input);
            right = draw(1) < probability;
            force = upright.disturb(task.noise, p.force * (2 * right - 1), draw);
            state = upright.step(p, state, force);
            fallen = upright.has_fallen(p, state);
            observation = upright.measure(task.noise, state, draw);

            % Remember the step.
            row = 1 + mod(step, s.kept_steps);
            inputs(row, :) = input;
            pushes(row) = right;
            probabilities(row) = probability * right + (1 - probability) * ~right;
            step = step + 1;
            watched = upright.internal.watch(chosen, numel(lengths) + 1, step, state, force, fallen);
        end
        if fallen
            episode = upright.internal.make_episode(s, step, inputs, pushes, probabilities);
            memory = upright.internal.policy_gradient(s, memory, episode);
        end
        if watched
            lengths(end + 1) = step; %#ok<AGROW>
            success = ~fallen;
        end
    end
    policy = upright.internal.reinforce_policy(s, memory.weights);
    result = upright.internal.end_run('reinforce', chosen, success, lengths, policy);
end

%!test  # it learns, and the same seed gives the same run
%! result = upright.reinforce ('steps', 500, 'seed', 1);
%! assert (result.success);
%! assert (result.lengths(end), 500);
%! again = upright.reinforce ('steps', 500, 'seed', 1);
%! assert (again.lengths, result.lengths);
%!error <logit_scale is 0> upright.reinforce ('settings', setfield (upright.settings ('reinforce'), 'logit_scale', 0))
