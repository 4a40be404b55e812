% UPRIGHT  Learning to balance an inverted pendulum: the cart-pole, its noises, and two learners.
%
% Learn
%   q_learning        tabular Q-learning, one run, readable
%   reinforce         policy gradient on the report's 4-8-16-1 network, one run, readable
%   settings          the settings of a learner
%
% Watch
%   animate           the cart-pole drawn as it learns
%   plot_learning     the learning curve
%
% Measure
%   run_trials        many runs at once, fast
%   table             the report's Table II, and the seven noise cases
%   build_mex         compile Q-learning, a hundred times as fast
%
% The cart-pole
%   parameters        masses, lengths, limits
%   step              the equations of motion
%   has_fallen        the end of a trial
%   noise_case        what disturbs the force and the measured angle
%   disturb, measure  the force that acts, the measurement that is seen
%
% What was learned
%   simulate          let a policy balance
%   push_probability  what a policy does with a measurement
%   export_policy     write a policy for Python and others
%   import_policy     read one
%   rl_env            an environment for the Reinforcement Learning Toolbox (untested)
%
% `help upright.q_learning` explains one of them. All units are SI, all angles are radians.
