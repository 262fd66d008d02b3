within WheelsetRig;
package Effects "Physical effects that the observer models leave out, one slot each"
  annotation (Documentation(info="<html>
<p>Each class extends the partial model of a slot of <code>MinimalObserver</code>. Its size is a
parameter whose default, zero, is the nominal model exactly; <code>min</code> and <code>max</code>
bound it for a fit. Errors of sensors are in <code>Sensors</code>.</p>
<h4>What an effect says of itself</h4>
<p>A class is found by a diagnosis through its annotation <code>__Workbench(effect(...))</code>, SI:</p>
<ul>
<li><code>size</code>: the parameter that is zero in the nominal model, or <code>{\"cosine\",
\"sine\"}</code> of an effect that turns with a shaft;</li>
<li><code>matters</code>: the least size worth a finding; <code>separation</code>: the experiment that
tells the effect from its twins;</li>
<li><code>shapes(p={...})</code>: other parameters to fit, with values to try;
<code>hidden</code>: why recorded stops cannot show it;</li>
<li><code>where(condition, is, share)</code>: it is only in stops whose condition is so, if any is;
the parameter <code>share</code> becomes the share of entries that are; <code>unless(condition, is,
because)</code>: it is not looked for if any stop is so; <code>falling(signal, because)</code>: it
shows only where an input falls; <code>restarted(because)</code>: it shows only where states are
restarted;</li>
<li><code>slots={...}</code>: which slots it fills, where the class it extends constrains
several;</li>
<li><code>after</code>: a more usual effect behind which it stands. Else the order of
<code>package.order</code> says which of two effects that look the same is the usual one.</li>
</ul>
<h4>Several effects in one slot</h4>
<p>A value goes into a slot and the value that acts comes out, so effects form a chain:</p>
<pre>
model PadFriction
  extends WheelsetRig.Brakes.PartialPadFriction;
  WheelsetRig.Effects.BeddingIn first(level=level, Fperp=Fperp, v=v);
  WheelsetRig.Effects.BrakeFade second(level=first.mu, Fperp=Fperp, v=v);
equation
  mu = second.mu;
end PadFriction;
</pre>
<p>The order in a chain matters only to second order: a film or a disc is heated by the friction up
to its own place in it. Where outputs of a slot are of another kind than its inputs, as of
<code>Losses.PartialLoss</code>, there is no chain: what effects change adds up. <code>lack</code> of
pad friction, what one disc lacks of the mean, is handed on by all but films on some of the discs.</p>
</html>"));
end Effects;
