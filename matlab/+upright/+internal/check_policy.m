function check_policy(policy)
%CHECK_POLICY  Stop with a clear error unless this is a policy as data.
%
%   Example:
%     result = upright.q_learning('steps', 100);
%     upright.internal.check_policy(result.policy);
    if ~isstruct(policy) || ~isfield(policy, 'form')
        refuse('policy is no struct with the field form');
    elseif strcmp(policy.form, 'table')
        check_table(policy);
    elseif strcmp(policy.form, 'network')
        check_network(policy);
    else
        refuse('form is ''%s''; it must be one of table, network', policy.form);
    end
end

function check_table(policy)
    if ~iscell(policy.edges) || numel(policy.edges) ~= 4
        refuse('edges must be a cell of four rows of numbers');
    end
    for k = 1:4
        edges = policy.edges{k};
        if ~isnumeric(edges) || ~all(isfinite(edges)) || any(diff(edges) <= 0)
            refuse('edges of measurement %d must be numbers that ascend', k);
        end
    end
    due = prod(cellfun(@numel, policy.edges) + 1);
    p = policy.probabilities;
    if ~isnumeric(p) || numel(p) ~= due
        refuse('there are %d probabilities; %d are due', numel(p), due);
    elseif ~all(p >= 0 & p <= 1)
        refuse('probabilities must be numbers from 0 to 1');
    end
end

function check_network(policy)
    upright.internal.require('past', policy.past, 0, 100, 'whole');
    if ~isempty(policy.scales) && ~(numel(policy.scales) == 4 && all(policy.scales > 0))
        refuse('scales must be four numbers above 0, or none');
    end
    if isempty(policy.layers)
        refuse('there are no layers');
    end
    inputs = 4 + 5 * policy.past;
    for layer = policy.layers
        units = {'isrlu', 'tanh', 'sigmoid', 'above zero', 'not below zero'};
        upright.internal.require_one_of('unit', layer.unit, units);
        if ~isnumeric(layer.weights) || size(layer.weights, 1) ~= inputs ...
                || ~all(isfinite(layer.weights(:)))
            refuse('weights must be numbers, a row for each of %d inputs', inputs);
        end
        inputs = size(layer.weights, 2);
    end
    if inputs ~= 1
        refuse('the last layer has %d units; it must have one', inputs);
    end
end

function refuse(varargin)
    error('upright:badPolicy', varargin{:});
end

%!error <form is 'tree'> upright.internal.check_policy (struct ('form', 'tree'))
%!error id=upright:badPolicy upright.internal.check_policy (3)
%!error <last layer has 2> upright.internal.check_policy (upright.internal.network_policy ({ones(4, 2)}, {'sigmoid'}, []))
%!error <four numbers above 0> upright.internal.check_policy (upright.internal.network_policy ({ones(4, 1)}, {'sigmoid'}, [1 0 1 1]))
%!error <ascend> upright.internal.check_policy (struct ('form', 'table', 'edges', {{[], [], [], [1 0]}}, 'probabilities', [1 1 1]))
%!error <from 0 to 1> upright.internal.check_policy (struct ('form', 'table', 'edges', {{[], [], [], []}}, 'probabilities', 2))
