function policy = import_policy(file)
%IMPORT_POLICY  Read a learned policy from a file.
%   policy = upright.import_policy(file) reads a file written by upright.export_policy, or by
%   `upright export policy.npz policy.json` in Python, and returns a struct for upright.simulate
%   and upright.push_probability. Octave may read some numbers with a different last bit.
%
%   Example:
%     policy = upright.import_policy('policy.json');
%     trajectory = upright.simulate(policy, 'noise', 'gaussian-0.1');
%
%   See also upright.export_policy, upright.simulate.
    if ~ischar(file) || exist(file, 'file') ~= 2
        error('upright:badValue', 'file is %s; there is no such file', ...
            upright.internal.shown(file));
    end
    try
        policy = jsondecode(fileread(file));
    catch problem
        refuse(file, problem.message);
    end
    due = upright.internal.policy_format();
    if ~isstruct(policy) || ~isfield(policy, 'format') || ~isequal(policy.format, due)
        refuse(file, sprintf('it does not say that its format is ''%s''', due));
    end
    try
        policy = tidied(policy);
        upright.internal.check_policy(policy);
    catch problem
        refuse(file, problem.message);
    end
end

function refuse(file, why)
    error('upright:badPolicy', 'file is ''%s''; it cannot be read: %s', file, why);
end

function policy = tidied(policy)
    % Undo how lists are read: lists of numbers as columns, lists of equal lists as a matrix.
    if strcmp(policy.form, 'table')
        edges = policy.edges;
        if isnumeric(edges)
            edges = num2cell(reshape(edges, 4, []), 2);
        end
        policy.edges = cellfun(@(some) reshape(some, 1, []), reshape(edges, 1, []), ...
            'UniformOutput', false);
        policy.probabilities = reshape(policy.probabilities, 1, []);
        return
    end
    layers = policy.layers;
    if iscell(layers)
        layers = [layers{:}];
    end
    inputs = 4 + 5 * policy.past;
    for k = 1:numel(layers)
        layers(k).weights = reshape(layers(k).weights, inputs, []);
        inputs = size(layers(k).weights, 2);
    end
    policy.layers = reshape(layers, 1, []);
    policy.scales = reshape(policy.scales, 1, []);
end

%!function refused (text, words)
%!  file = [tempname() '.json'];
%!  handle = fopen (file, 'w'); fputs (handle, text); fclose (handle);
%!  fail (sprintf ("upright.import_policy ('%s')", file), words);
%!  delete (file);
%!endfunction
%!test refused ('{"a": 1', 'cannot be read');
%!test refused ('[1, 2]', 'format');
%!test refused ('{"format": "other"}', 'format');
%!test refused ('{"format": "upright policy form 1"}', 'form');
%!test refused ('{"format": "upright policy form 1", "form": "table", "edges": [[], [], [], [0]], "probabilities": [1]}', '2 are due');
%!test refused ('{"format": "upright policy form 1", "form": "network", "scales": null, "past": 0, "layers": [{"unit": "relu", "weights": [[1],[2],[3],[4]]}]}', 'relu');
%!test refused ('{"format": "upright policy form 1", "form": "network", "scales": null, "past": 0, "layers": [{"unit": "sigmoid", "weights": [[1],[2],[3]]}]}', 'cannot be read');
%!error id=upright:badValue upright.import_policy ('there is none.json')
