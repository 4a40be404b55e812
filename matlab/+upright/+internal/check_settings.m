function check_settings(agent, s)
%CHECK_SETTINGS  Stop with a clear error unless these can be the settings of an agent.
%
%   Example:
%     upright.internal.check_settings('q-learning', upright.settings('q-learning'))
    due = fieldnames(upright.settings(agent));
    if ~isstruct(s) || ~isscalar(s) || ~isequal(sort(fieldnames(s)), sort(due))
        error('upright:badSettings', ...
            'settings are not those of %s; begin with upright.settings(''%s''), a struct of %s', ...
            agent, agent, strjoin(due', ', '));
    end
    switch agent
        case 'q-learning'
            check_q_learning(s);
        case 'reinforce'
            check_reinforce(s);
        otherwise
            check_scales(s);
    end
end

function check_q_learning(s)
    check = @upright.internal.require;
    check('learning_rate', s.learning_rate, 0, 1);
    check('discount', s.discount, 0, 1);
    check('replay_passes', s.replay_passes, 0, 1000, 'whole');
    check('replay_size', s.replay_size, 1, 1e7, 'whole');
    check('trace_decay', s.trace_decay, 0, 1);
    check('mirrored', s.mirrored, 0, 1, 'whole');
    check('jitter', s.jitter, 0, Inf);
    boxes = 1;
    for name = {'x_edges', 'x_dot_edges', 'theta_edges', 'theta_dot_edges'}
        edges = s.(name{1});
        if ~isnumeric(edges) || numel(edges) ~= size(edges, 2) || ~all(isfinite(edges)) ...
                || any(diff(edges) <= 0)
            error('upright:badValue', '%s is %s; it must be a row of numbers that ascend', ...
                name{1}, mat2str(edges));
        end
        if s.mirrored && any(abs(edges + fliplr(edges)) > 1e-8 + 1e-5 * abs(edges))
            error('upright:badValue', '%s is %s; mirrored boxes need edges alike in +-', ...
                name{1}, mat2str(edges));
        end
        boxes = boxes * (numel(edges) + 1);
    end
    check('the number of boxes', boxes, 1, 1e6);
end

function check_reinforce(s)
    check = @upright.internal.require;
    check('learning_rate', s.learning_rate, 0, Inf, 'above');
    check('discount', s.discount, 0, 1);
    upright.internal.require_one_of('baseline', s.baseline, {'mean', 'fitted'});
    for name = {'episodes', 'kept_steps', 'epochs', 'stride'}
        check(name{1}, s.(name{1}), 1, 1e6, 'whole');
    end
    check('episodes * kept_steps', s.episodes * s.kept_steps, 1, 5e6);
    for name = {'beta1', 'beta2', 'weight_decay'}
        check(name{1}, s.(name{1}), 0, 0.999999);
    end
    check('init_std', s.init_std, 0, Inf);
    check('logit_scale', s.logit_scale, 0, Inf, 'above');
    check_scales(s);
end

function check_scales(s)
    for name = {'x_scale', 'x_dot_scale', 'theta_scale', 'theta_dot_scale'}
        upright.internal.require(name{1}, s.(name{1}), 0, Inf, 'above');
    end
end

%!function s = with (agent, name, value)
%!  s = upright.settings (agent);
%!  s.(name) = value;
%!endfunction
%!test
%! for agent = {'q-learning', 'reinforce', 'random-search'}
%!   for label = {'default', 'as-published'}
%!     upright.internal.check_settings (agent{1}, upright.settings (agent{1}, label{1}));
%!   end
%! end
%!error <learning_rate is 1.5; it must be a number, at least 0 and at most 1> upright.internal.check_settings ('q-learning', with ('q-learning', 'learning_rate', 1.5))
%!error <learning_rate is NaN> upright.internal.check_settings ('q-learning', with ('q-learning', 'learning_rate', NaN))
%!error <theta_edges is .*ascend> upright.internal.check_settings ('q-learning', with ('q-learning', 'theta_edges', [1 0]))
%!error <alike in> upright.internal.check_settings ('q-learning', with ('q-learning', 'theta_edges', [-1 0]))
%!error <baseline is 'none'> upright.internal.check_settings ('reinforce', with ('reinforce', 'baseline', 'none'))
%!error id=upright:badSettings upright.internal.check_settings ('q-learning', struct ('alpha', 1))
