function name = policy_format()
%POLICY_FORMAT  What a file of a policy says of its format.
%
%   Example:
%     upright.internal.policy_format()
    name = 'upright policy form 1';
end
