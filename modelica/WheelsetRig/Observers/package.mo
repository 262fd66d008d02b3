within WheelsetRig;
package Observers "Observers as models: measured signals in, friction and creep force out"
  annotation (Documentation(info="<html>
<p>The parameter estimator and the disturbance observer after C. Schwarz, J. Brembeck, B. Heckmann
(2018), equations (7) to (10), around the observer models of this library.</p>
<h4>Time</h4>
<p>The models are in continuous time. <code>Sampled</code> and <code>Applied</code> mark what an
observer that runs sample by sample takes once per sample; here both follow within one
<code>samplePeriod</code>. An exported FMU takes one linearly implicit Euler step per sample, in
which they follow at once, and keeps states within their <code>min</code> and <code>max</code>.</p>
<h4>Two factors that the paper does not have</h4>
<p><em>Authority</em>: a friction is corrected in proportion to its effect on
<code>der(omegaW)</code>, which vanishes without pressure or slip and changes sign in reverse.
<em>Fading</em>: below walking pace measured slip is noise, and feedback vanishes.</p>
<h4>Limits</h4>
<p>The authority is that of the nominal slots of the observer model: friction that acts must be
proportional to <code>muWR + dmuWR</code> and <code>muDC + dmuDC</code>.</p>
</html>"));
end Observers;
