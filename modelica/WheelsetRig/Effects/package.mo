within WheelsetRig;
package Effects "Physical effects that the observer models leave out, one slot each"
  annotation (Documentation(info="<html>
<p>Each class extends the partial model of a slot of <code>MinimalObserver</code>. Its size is a
parameter whose default, zero, is the nominal model exactly; <code>min</code> and <code>max</code>
bound it for a fit. Errors of sensors are in <code>Sensors</code>.</p>
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
to its own place in it.</p>
</html>"));
end Effects;
