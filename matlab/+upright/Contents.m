% UPRIGHT  Learning to balance an inverted pendulum: cart-pole, noise cases, and two learners.
%
% Learn
%   q_learning        tabular Q-learning, one run, readable
%   reinforce         policy gradient on the report's 4-8-16-1 network, one run, readable
%   settings          the settings of a learner
%
% Watch
%   animate           draw the cart-pole as it learns
%   plot_learning     plot learning curves
%
% Measure
%   run_trials        many runs at once, fast
%   table             the report's tables, for the seven noise cases
%   build_mex         compile Q-learning, which makes it a hundred times as fast
%
% The cart-pole
%   parameters        masses, lengths, limits
%   step              the equations of motion
%   has_fallen        the end of a trial
%   noise_case        what disturbs the force and the measured angle
%   disturb, measure  the applied force, and what the learner observes
%
% Learned policies
%   simulate          let a policy balance
%   push_probability  evaluate a policy on a measurement
%   export_policy     write a policy to a file, for Python and other programs
%   import_policy     read a policy from a file
%   rl_env            an environment for the Reinforcement Learning Toolbox (untested)
%
% `help upright.NAME` explains a function. All units are SI, all angles are radians.
