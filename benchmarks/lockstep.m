function lockstep(make, agent, count, steps)
%LOCKSTEP  How fast runs advance in lockstep; prints what benchmarks/matlab.py reads.
%   lockstep(make, agent, count, steps) makes so many runs, noise-free, and prints: learner-steps a
%   second while at least nine tenths of the runs advance together; the same of the whole study, whose
%   last runs advance nearly alone; and the study's seconds.
%
%   Example:
%     addpath matlab benchmarks; lockstep(@upright.internal.q_learners, 'q-learning', 1000, 60000)
    options = upright.internal.task_options();
    options.steps = steps;
    task = upright.internal.make_task(options);
    random = upright.internal.random_streams(upright.internal.stream_number(0, 1:count));
    learners = make(upright.settings(agent), count, random);
    learn_as_it_is = learners.learn;
    learners.learn = @learn_and_count;
    together = 0;                                      % learner-steps while they advance together
    seconds = 0;                                       % and how long these took
    total = 0;
    before = 0;
    began = tic();
    upright.internal.lockstep(learners, task, random, count, @(varargin) []);
    fprintf('%g %g %g\n', together / seconds, total / toc(began), toc(began));

    function learn_and_count(runs, varargin)
        learn_as_it_is(runs, varargin{:});
        now = toc(began);
        total = total + numel(runs);
        if numel(runs) >= 0.9 * count
            together = together + numel(runs);
            seconds = seconds + now - before;
        end
        before = now;
    end
end
