function draw = random_streams(numbers)
%RANDOM_STREAMS  A stream of random numbers for each run: the Mersenne Twister.
%   draw = upright.internal.random_streams(numbers) returns a function: draw(runs, k) gives the
%   next k numbers of each of those runs, numel(runs)-by-k, uniform from 0 to 1. Run r has what
%   rand gives after rng(numbers(r)) in MATLAB, and numpy.random.RandomState(numbers(r)).random()
%   in Python, bit for bit. The state of rand itself stays as it is.
%
%     numbers   one for each run, whole, from 1 to 2^32 - 1
%     runs      column of indices into numbers
%
%   Example:
%     draw = upright.internal.random_streams([1 2]);
%     draw([1; 2], 3)                                  % 2-by-3
%
%   See also upright.run_trials.
    BLOCK = 1024;                                      % numbers drawn at once for a run
    count = numel(numbers);
    buffer = zeros(BLOCK, count);
    used = BLOCK * ones(count, 1);
    in_octave = exist('OCTAVE_VERSION', 'builtin') > 0;
    states = [];
    streams = cell(count, 1);
    if in_octave
        states = twister_states(numbers);
    else
        for run = 1:count
            streams{run} = RandStream('mt19937ar', 'Seed', numbers(run));
        end
    end
    draw = @next;

    function uniform = next(runs, k)
        if k > BLOCK
            uniform = [next(runs, BLOCK), next(runs, k - BLOCK)];
            return
        end
        places = used(runs);
        short = places > BLOCK - k;
        if any(short)
            for run = runs(short)'
                refill(run);
            end
            places = used(runs);
        end
        used(runs) = places + k;
        uniform = buffer(places + (runs - 1) * BLOCK + (1:k));
        uniform = reshape(uniform, numel(runs), k);
    end

    function refill(run)
        rest = buffer(used(run) + 1:BLOCK, run);
        buffer(:, run) = [rest; fresh(run, used(run))];
        used(run) = 0;
    end

    function uniform = fresh(run, k)
        if ~in_octave
            uniform = rand(streams{run}, k, 1);
            return
        end
        before = rand('twister');
        rand('twister', states(:, run));
        uniform = rand(k, 1);
        states(:, run) = rand('twister');
        rand('twister', before);
    end
end

function states = twister_states(numbers)
    % Octave takes a whole state: 624 words, set as the twister's authors do (M. Matsumoto,
    % T. Nishimura, init_genrand, 2002), and how many of them are left.
    word = reshape(numbers, 1, []);
    states = zeros(625, numel(numbers));
    states(1, :) = word;
    for i = 1:623
        mixed = bitxor(word, floor(word / 2^30));
        % 1812433253 * mixed + i, modulo 2^32, in parts that a double holds exactly.
        high = mod(27655 * mixed, 65536) * 65536;
        word = mod(high + 35173 * mixed + i, 2^32);
        states(i + 1, :) = word;
    end
    states(625, :) = 1;
end

%!test  # what the authors of the twister, MATLAB and NumPy give for the seeds 5489 and 1
%! draw = upright.internal.random_streams ([5489 1]);
%! assert (draw ([1; 2], 2), [0.8147236863931789 0.9057919370756192; 0.417022004702574 0.7203244934421581], 1e-15);
%!test  # what is drawn does not hang on how, and rand is left alone
%! rand ('twister', 7); a = rand ();
%! rand ('twister', 7);
%! one = upright.internal.random_streams (11:13);
%! other = upright.internal.random_streams (11:13);
%! apart = []; for k = 1:1500, apart = [apart, one([1; 3], 2)]; end
%! assert (apart, other([1; 3], 3000));
%! assert (one(2, 5), other(2, 5));
%! assert (rand (), a);
