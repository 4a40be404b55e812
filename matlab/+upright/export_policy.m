function export_policy(policy, file)
%EXPORT_POLICY  Write a learned policy to a file, for Python and other programs.
%   upright.export_policy(policy, file) writes the policy as JSON, with everything you need to know
%   to use it. The file is written completely or not at all. `upright play policy.json` plays it in
%   Python.
%
%     policy   a learned policy: result.policy
%     file     name of a file that ends in .json
%
%   Example:
%     result = upright.q_learning();
%     upright.export_policy(result.policy, 'policy.json');
%
%   See also upright.import_policy, upright.simulate.
    upright.internal.check_output('file', file, {'.json'});
    upright.internal.check_policy(policy);
    if ~isfield(policy, 'agent') || ~isfield(policy, 'task')
        error('upright:badPolicy', ...
            'policy does not say who learned it, and on what: fields agent and task');
    end
    entries = struct('format', upright.internal.policy_format());
    for name = {'agent', 'task', 'form'}
        entries.(name{1}) = policy.(name{1});
    end
    if strcmp(policy.form, 'table')
        entries.edges = reshape(policy.edges, 1, []);
        entries.probabilities = policy.probabilities;
    else
        entries.scales = policy.scales;
        entries.past = policy.past;
        entries.layers = num2cell(reshape(policy.layers, 1, []));
        for k = 1:numel(entries.layers)
            entries.layers{k}.weights = num2cell(entries.layers{k}.weights, 2)';
        end
    end
    text = [upright.internal.to_json(entries) sprintf('\n')];
    upright.internal.write_whole(file, @(part) write_text(part, text));
end

function write_text(file, text)
    handle = fopen(file, 'w');
    written = fwrite(handle, text);
    if fclose(handle) ~= 0 || written ~= numel(text)
        error('upright:cannotWrite', 'the disk is full, or gone');
    end
end

%!test  # both forms come back as they were, but for the last bit of a number
%! for learn = {@upright.q_learning, @upright.reinforce}
%!   result = learn{1} ('steps', 100);
%!   file = [tempname() '.json'];
%!   upright.export_policy (result.policy, file);
%!   back = upright.import_policy (file);
%!   delete (file);
%!   seen = bsxfun (@times, 2 * rand (1000, 4) - 1, [2 2 0.2 2]);
%!   assert (upright.push_probability (back, seen), upright.push_probability (result.policy, seen), 1e-12);
%!   assert (back.task, result.policy.task);
%! end
%!error id=upright:badValue upright.export_policy (struct (), 'policy.txt')
%!error id=upright:badPolicy upright.export_policy (struct (), fullfile (tempdir (), 'policy.json'))
%!error id=upright:cannotWrite upright.export_policy (struct (), fullfile ('no', 'such', 'policy.json'))
